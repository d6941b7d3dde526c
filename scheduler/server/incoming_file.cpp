// SPDX-License-Identifier: AGPL-3.0-or-later
#include "scheduler/server/incoming_file.h"

#include <fcntl.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <utility>

#include <fmt/format.h>

#include "services/rpc/limits.h"

namespace vorocast::server {

IncomingFile::~IncomingFile() {
  if (file_ >= 0) close(file_);
  std::error_code ignored;
  if (!temporary_.empty()) std::filesystem::remove(temporary_, ignored);
}

absl::Status IncomingFile::Begin(const std::filesystem::path& temporary, std::int64_t size, std::string what) {
  temporary_ = temporary;
  size_ = size;
  what_ = std::move(what);
  file_ = open(temporary_.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0644);
  if (file_ < 0 && errno == ENOSPC) return absl::ResourceExhaustedError("the artifact folder's disk is full");
  if (file_ < 0) return absl::UnavailableError(fmt::format("{}: cannot be written: {}", temporary_.string(), std::strerror(errno)));
  return absl::OkStatus();
}

absl::Status IncomingFile::Write(const std::string& bytes) {
  if (static_cast<std::int64_t>(bytes.size()) > rpc::kChunkBytesMax) return absl::InvalidArgumentError("a chunk has at most 1 MiB");
  if (written_ + static_cast<std::int64_t>(bytes.size()) > size_) {
    return absl::DataLossError(fmt::format("{}: more bytes than the {} it should have", what_, size_));
  }
  for (std::size_t at = 0; at < bytes.size();) {
    const ssize_t count = write(file_, bytes.data() + at, bytes.size() - at);
    if (count < 0 && errno == EINTR) continue;
    if (count < 0 && errno == ENOSPC) return absl::ResourceExhaustedError("the artifact folder's disk is full");
    if (count < 0) return absl::UnavailableError(fmt::format("{}: cannot be written: {}", temporary_.string(), std::strerror(errno)));
    at += static_cast<std::size_t>(count);
  }
  written_ += static_cast<std::int64_t>(bytes.size());
  hasher_.Update(bytes);
  return absl::OkStatus();
}

absl::StatusOr<base::Digest> IncomingFile::End() {
  if (written_ != size_) return absl::DataLossError(fmt::format("{}: {} of {} bytes came; send it again", what_, written_, size_));
  close(file_);
  file_ = -1;
  return hasher_.Finish();
}

}  // namespace vorocast::server
