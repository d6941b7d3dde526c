// SPDX-License-Identifier: AGPL-3.0-or-later
#include "scheduler/store/state_lock.h"

#include <fcntl.h>
#include <sys/file.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <string>
#include <utility>

#include <fmt/format.h>

namespace vorocast::store {

absl::StatusOr<StateLock> StateLock::Take(const std::filesystem::path& state) {
  const std::filesystem::path path = state / "scheduler.lock";
  const int file = open(path.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0644);
  if (file < 0) return absl::UnavailableError(fmt::format("{}: cannot be opened: {}", path.string(), std::strerror(errno)));
  StateLock lock(file);
  if (flock(file, LOCK_EX | LOCK_NB) != 0) {
    char holder[32] = {};
    const ssize_t size = pread(file, holder, sizeof holder - 1, 0);
    return absl::FailedPreconditionError(fmt::format("{}: another scheduler (process {}) serves this folder; use that one, or stop it first",
                                                     state.string(), size > 0 ? std::string(holder) : "unknown"));
  }
  const std::string own = std::to_string(getpid());
  if (ftruncate(file, 0) != 0 || pwrite(file, own.data(), own.size(), 0) != static_cast<ssize_t>(own.size())) {
    return absl::UnavailableError(fmt::format("{}: cannot be written: {}", path.string(), std::strerror(errno)));
  }
  return lock;
}

StateLock::StateLock(StateLock&& other) noexcept : file_(std::exchange(other.file_, -1)) {}
StateLock& StateLock::operator=(StateLock&& other) noexcept {
  std::swap(file_, other.file_);
  return *this;
}
StateLock::~StateLock() {
  if (file_ >= 0) close(file_);
}

}  // namespace vorocast::store
