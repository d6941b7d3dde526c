// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>

#include "services/base/digest.h"
#include "services/base/status.h"

namespace vorocast::server {

/// A file on its way in, under a temporary name until it is known to be whole. Not published, it leaves nothing behind. Used by one thread at a time.
class IncomingFile {
 public:
  IncomingFile() = default;
  ~IncomingFile();
  IncomingFile(const IncomingFile&) = delete;
  IncomingFile& operator=(const IncomingFile&) = delete;

  bool begun() const { return file_ >= 0; }
  /// Once. `what` is for messages: "blob 1a2b3c4d".
  absl::Status Begin(const std::filesystem::path& temporary, std::int64_t size, std::string what);
  /// The next bytes, at most a chunk of them. DATA_LOSS when they are more than the file should have.
  absl::Status Write(const std::string& bytes);
  /// After the last of them: DATA_LOSS unless all have come. Returns their digest.
  absl::StatusOr<base::Digest> End();
  const std::filesystem::path& path() const { return temporary_; }

 private:
  std::filesystem::path temporary_;
  std::string what_;
  base::Hasher hasher_;
  int file_ = -1;
  std::int64_t size_ = 0;
  std::int64_t written_ = 0;
};

}  // namespace vorocast::server
