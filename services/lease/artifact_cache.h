// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <cstdint>
#include <filesystem>
#include <mutex>
#include <optional>

#include "services/base/status.h"
#include "services/lease/child_process.h"
#include "services/storage/artifact_store.h"

namespace vorocast::lease {

/// A folder in which a worker keeps what it was sent, under the names of the artifact folder (docs/storage_format.md), up to a limit. What was used
/// longest ago goes first, and never what somebody holds. Several workers of one machine may share a folder.
class ArtifactCache {
 public:
  /// A file that stays as long as this lives.
  using Hold = FileDescriptor;

  /// `limit`: bytes of all files together.
  static absl::StatusOr<ArtifactCache> Open(const std::filesystem::path& folder, std::int64_t limit);
  ArtifactCache(ArtifactCache&& other) noexcept : store_(std::move(other.store_)), limit_(other.limit_) {}

  const storage::ArtifactStore& store() const { return store_; }
  /// Nothing when the file is not there.
  std::optional<Hold> HoldIfThere(const std::filesystem::path& file) const;
  /// Removes files until `bytes` more fit, or until the rest is held. From any thread.
  void MakeRoom(std::int64_t bytes);

 private:
  ArtifactCache(storage::ArtifactStore store, std::int64_t limit) : store_(std::move(store)), limit_(limit) {}

  const storage::ArtifactStore store_;
  const std::int64_t limit_;
  std::mutex mutex_;
};

}  // namespace vorocast::lease
