// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <filesystem>

#include "services/base/status.h"

namespace vorocast::store {

/// Held by the one scheduler that serves a state folder; the kernel frees it when that process ends, however it ends.
class StateLock {
 public:
  /// FAILED_PRECONDITION names the process that holds it.
  static absl::StatusOr<StateLock> Take(const std::filesystem::path& state);
  StateLock(StateLock&& other) noexcept;
  StateLock& operator=(StateLock&& other) noexcept;
  ~StateLock();

 private:
  explicit StateLock(int file) : file_(file) {}
  int file_ = -1;
};

}  // namespace vorocast::store
