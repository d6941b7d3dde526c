// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <cstdint>
#include <filesystem>
#include <string_view>
#include <utility>

#include "absl/time/time.h"
#include "services/base/digest.h"
#include "services/base/status.h"

namespace vorocast::storage {

/// The folder that all processes of one service share:
///   blobs/ab/abcd….ply       captured frames, named by the SHA-256 of their bytes
///   artifacts/ab/abcd….h5    results, named by the key of what made them
///   tmp/                     files being written; renamed into place when whole
/// A file under blobs/ or artifacts/ is complete and never changes. Any number of processes may read and publish at once.
class ArtifactStore {
 public:
  /// Creates the folders if need be.
  static absl::StatusOr<ArtifactStore> Open(const std::filesystem::path& root);

  std::filesystem::path BlobPath(const base::Digest& digest, std::string_view extension) const;
  std::filesystem::path ArtifactPath(const base::Digest& key, std::string_view extension) const;
  bool HasBlob(const base::Digest& digest, std::string_view extension) const;
  bool HasArtifact(const base::Digest& key, std::string_view extension) const;

  /// A fresh name under tmp/ for a file to be written and then published.
  std::filesystem::path TemporaryPath(std::string_view extension) const;
  /// fsyncs `temporary` and its new folder and renames it into place. Publishing a name twice is harmless: the first stays.
  absl::Status PublishArtifact(const std::filesystem::path& temporary, const base::Digest& key, std::string_view extension) const;
  /// The same for a blob; refuses (DATA_LOSS) bytes that do not have the digest.
  absl::Status PublishBlob(const std::filesystem::path& temporary, const base::Digest& digest, std::string_view extension) const;

  /// Removes files under tmp/ whose writer, a process of this machine, has died; younger ones than `minimum_age` are left, in case process
  /// numbers mean something else in another container of the same host name. Returns how many were removed.
  std::int64_t RemoveStaleTemporaries(absl::Duration minimum_age) const;

  const std::filesystem::path& root() const { return root_; }

 private:
  explicit ArtifactStore(std::filesystem::path root) : root_(std::move(root)) {}
  std::filesystem::path root_;
};

}  // namespace vorocast::storage
