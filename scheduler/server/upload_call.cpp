// SPDX-License-Identifier: AGPL-3.0-or-later
#include "scheduler/server/upload_call.h"

#include <algorithm>

#include <fmt/format.h>

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
  if (file_.begun()) return absl::InvalidArgumentError("only the first message names the blob");
  ASSIGN_OR_RETURN(digest_, CheckBlob(blob));
  blob_ = blob;
  return file_.Begin(artifacts_.TemporaryPath(blob.extension()), blob.size(), fmt::format("blob {}", digest_.Short()));
}

absl::Status UploadCall::Write(const std::string& bytes) {
  if (!file_.begun()) return absl::InvalidArgumentError("the first message must name the blob");
  return file_.Write(bytes);
}

absl::Status UploadCall::Publish() {
  if (!file_.begun()) return absl::InvalidArgumentError("the first message must name the blob");
  RETURN_IF_ERROR(file_.End().status());
  RETURN_IF_ERROR(artifacts_.PublishBlob(file_.path(), digest_, blob_.extension()));
  metrics_.Uploaded(blob_.size());
  return absl::OkStatus();
}

}  // namespace vorocast::server
