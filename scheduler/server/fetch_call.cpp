// SPDX-License-Identifier: AGPL-3.0-or-later
#include "scheduler/server/fetch_call.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>

#include <fmt/format.h>

#include "absl/time/clock.h"

#include "services/rpc/limits.h"
#include "services/rpc/status.h"
#include "services/storage/collection.h"

namespace vorocast::server {

template <typename Chunk>
FileCall<Chunk>::~FileCall() {
  if (file_ >= 0) close(file_);
}

template <typename Chunk>
void FileCall<Chunk>::Refuse(const absl::Status& status) {
  this->Finish(rpc::ToGrpc(status));
}

template <typename Chunk>
void FileCall<Chunk>::Send(const std::filesystem::path& path, const std::string& sha256) {
  disk_.Run([this, path, sha256] {
    if (const absl::Status status = Open(path, sha256); !status.ok()) return Refuse(status);
    WriteNext();
  });
}

template <typename Chunk>
absl::Status FileCall<Chunk>::Open(const std::filesystem::path& path, const std::string& sha256) {
  storage::NoteUse(path, absl::Now());
  file_ = open(path.c_str(), O_RDONLY | O_CLOEXEC);
  struct stat info {};
  if (file_ < 0 || fstat(file_, &info) != 0) {
    return absl::DataLossError(
        fmt::format("{}: it is on record but cannot be read: {}; if it has been collected, retry the job (a frame: submit the capture again)",
                    path.string(), std::strerror(errno)));
  }
  left_ = info.st_size;
  chunk_.set_size(info.st_size);
  chunk_.set_sha256(sha256);
  return absl::OkStatus();
}

template <typename Chunk>
void FileCall<Chunk>::WriteNext() {
  if (left_ == 0 && !first_) return this->Finish(grpc::Status::OK);
  std::string& bytes = *chunk_.mutable_data();
  bytes.resize(static_cast<std::size_t>(std::min(left_, rpc::kChunkBytesMax)));
  for (std::size_t at = 0; at < bytes.size();) {
    const ssize_t count = read(file_, bytes.data() + at, bytes.size() - at);
    if (count < 0 && errno == EINTR) continue;
    if (count <= 0) return Refuse(absl::DataLossError("the result cannot be read to its end"));
    at += static_cast<std::size_t>(count);
  }
  left_ -= static_cast<std::int64_t>(bytes.size());
  first_ = false;
  this->StartWrite(&chunk_);
}

template <typename Chunk>
void FileCall<Chunk>::OnWriteDone(bool ok) {
  if (!ok) return Refuse(absl::CancelledError("the client has gone"));
  chunk_.Clear();
  disk_.Run([this] { WriteNext(); });
}

template class FileCall<v1::FetchChunk>;
template class FileCall<v1::ArtifactChunk>;

}  // namespace vorocast::server
