// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <sys/types.h>

#include <cstdint>
#include <map>
#include <mutex>
#include <string>

#include "services/base/status.h"
#include "services/storage/artifact_store.h"
#include "services/tasks/task.h"

namespace vorocast::lease {

/// Reads what a task is about to read and holds it against its digest, so that a flipped bit or a cut file ends in an error and never in a result.
/// A file that has been read once and has not been written since is not read again. Safe to call from several threads.
class InputCheck {
 public:
  /// What a damaged file is.
  enum class Files {
    kStored,  // the result or frame itself
    kCopies,  // a copy of it, which is removed, so that it is brought anew
  };
  /// DATA_LOSS names the file and what to do about it; NOT_FOUND for an input that is not in the store.
  absl::Status Check(const tasks::TaskSpec& spec, const storage::ArtifactStore& store, Files files = Files::kStored);

 private:
  /// What the kernel changes whenever a file's bytes are written or the file is replaced.
  struct Stamp {
    ino_t inode = 0;
    off_t size = 0;
    std::int64_t written_ns = 0;
    std::int64_t changed_ns = 0;
    friend bool operator==(const Stamp&, const Stamp&) = default;
  };
  static absl::StatusOr<Stamp> StampOf(const std::string& path);
  absl::Status CheckFile(const std::string& path, const base::Digest& expected);

  std::mutex mutex_;
  std::map<std::string, Stamp> right_;  // guarded by mutex_; files that were right, with their stamps then
};

}  // namespace vorocast::lease
