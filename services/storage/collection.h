// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "absl/time/time.h"
#include "services/base/digest.h"
#include "services/base/status.h"
#include "services/storage/artifact_store.h"

/// Finds what lies in the artifact folder, and removes it. When a file was last used is its modification time: its bytes never change.
namespace vorocast::storage {

struct StoredFile {
  enum class What : std::uint8_t { kBlob, kResult };
  What what = What::kBlob;
  base::Digest digest;  // of the blob's bytes, or the result's key
  std::string extension;
  std::int64_t size = 0;
  absl::Time used;
};

/// Every captured frame and result; files of other names are passed over. Ends early once `stop` says so. UNAVAILABLE when the folder cannot be
/// read.
absl::StatusOr<std::vector<StoredFile>> ListStored(const ArtifactStore& store, const std::function<bool()>& stop);

/// Notes that a file is wanted now, unless that was noted in the last minute. Nothing if it is not there. To be called before it is relied on
/// that a file is there; what has been noted is not discarded by this process, if it keeps all that was used within minutes.
void NoteUse(const std::filesystem::path& path, absl::Time now);

/// Removes the file unless it has been used since `used`; true if it went. It leaves its name by one rename, so a crash leaves it whole or gone.
absl::StatusOr<bool> Discard(const ArtifactStore& store, const StoredFile& file);

/// Removes what an earlier process discarded and had no time to remove.
void EmptyTrash(const ArtifactStore& store);

}  // namespace vorocast::storage
