// SPDX-License-Identifier: AGPL-3.0-or-later
#include "scheduler/server/upload_call.h"

#include <fcntl.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>

#include <fmt/format.h>

#include "services/rpc/limits.h"
#include "services/rpc/status.h"

namespace vorocast::server {
namespace {

constexpr std::int64_t kBlobBytesMax = std::int64_t{2} << 30;
constexpr std::string_view kExtensions[] = {".ply", ".obj", ".off", ".drc"};

}  // namespace

absl::StatusOr<base::Digest> CheckBlob(const v1::Blob& blob) {
  ASSIGN_OR_RETURN(const base::Digest digest, rpc::ParseDigest(blob.sha256(), "blob.sha256"));
  if (std::find(std::begin(kExtensions), std::end(kExtensions), blob.extension()) == std::end(kExtensions)) {
    return absl::InvalidArgumentError("blob.extension is unknown; it must be .ply, .obj, .off or .drc");
  }
  if (blob.size() < 0 || blob.size() > kBlobBytesMax) {
    return absl::InvalidArgumentError(fmt::format("blob.size is {}; a frame has at most {} bytes", blob.size(), kBlobBytesMax));
  }
  return digest;
}

UploadCall::UploadCall(const storage::ArtifactStore& artifacts, DiskThreads& disk, SchedulerMetrics& metrics)
    : artifacts_(artifacts), disk_(disk), metrics_(metrics) {
  StartRead(&chunk_);
}

UploadCall::~UploadCall() {
  if (file_ >= 0) close(file_);
  std::error_code ignored;
  if (!temporary_.empty()) std::filesystem::remove(temporary_, ignored);
}

void UploadCall::OnReadDone(bool ok) {
  disk_.Run([this, ok] { Take(ok); });
}

void UploadCall::Take(bool ok) {
  if (!ok) return Finish(rpc::ToGrpc(Publish()));
  absl::Status status;
  if (chunk_.has_blob()) status = Begin(chunk_.blob());
  if (status.ok()) status = Write(chunk_.data());
  if (!status.ok()) return Finish(rpc::ToGrpc(status));
  StartRead(&chunk_);
}

absl::Status UploadCall::Begin(const v1::Blob& blob) {
  if (file_ >= 0) return absl::InvalidArgumentError("only the first message names the blob");
  ASSIGN_OR_RETURN(digest_, CheckBlob(blob));
  blob_ = blob;
  temporary_ = artifacts_.TemporaryPath(blob.extension());
  file_ = open(temporary_.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0644);
  if (file_ < 0) return absl::UnavailableError(fmt::format("{}: cannot be written: {}", temporary_.string(), std::strerror(errno)));
  return absl::OkStatus();
}

absl::Status UploadCall::Write(const std::string& bytes) {
  if (file_ < 0) return absl::InvalidArgumentError("the first message must name the blob");
  if (static_cast<std::int64_t>(bytes.size()) > rpc::kChunkBytesMax) return absl::InvalidArgumentError("a chunk has at most 1 MiB");
  if (written_ + static_cast<std::int64_t>(bytes.size()) > blob_.size()) {
    return absl::DataLossError(fmt::format("blob {}: more bytes than the {} it should have", digest_.Short(), blob_.size()));
  }
  for (std::size_t at = 0; at < bytes.size();) {
    const ssize_t count = write(file_, bytes.data() + at, bytes.size() - at);
    if (count < 0 && errno == EINTR) continue;
    if (count < 0 && errno == ENOSPC) return absl::ResourceExhaustedError("the artifact folder's disk is full");
    if (count < 0) return absl::UnavailableError(fmt::format("{}: cannot be written: {}", temporary_.string(), std::strerror(errno)));
    at += static_cast<std::size_t>(count);
  }
  written_ += static_cast<std::int64_t>(bytes.size());
  return absl::OkStatus();
}

absl::Status UploadCall::Publish() {
  if (file_ < 0) return absl::InvalidArgumentError("the first message must name the blob");
  if (written_ != blob_.size()) {
    return absl::DataLossError(fmt::format("blob {}: {} of {} bytes came; send it again", digest_.Short(), written_, blob_.size()));
  }
  close(file_);
  file_ = -1;
  RETURN_IF_ERROR(artifacts_.PublishBlob(temporary_, digest_, blob_.extension()));
  metrics_.Uploaded(written_);
  return absl::OkStatus();
}

}  // namespace vorocast::server
