// SPDX-License-Identifier: AGPL-3.0-or-later
#include "services/lease/artifact_cache.h"

#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <vector>

namespace vorocast::lease {
namespace {

namespace fs = std::filesystem;

struct Kept {
  fs::path path;
  std::int64_t size = 0;
  fs::file_time_type used;
};

/// All files below a folder, those used longest ago first.
void Collect(const fs::path& folder, std::vector<Kept>& kept) {
  std::error_code error;
  for (fs::recursive_directory_iterator entry(folder, error), end; !error && entry != end; entry.increment(error)) {
    std::error_code gone;
    if (!entry->is_regular_file(gone)) continue;
    const auto size = static_cast<std::int64_t>(entry->file_size(gone));
    const auto used = entry->last_write_time(gone);
    if (!gone) kept.push_back({entry->path(), size, used});
  }
}

/// A lock that others hold for reading cannot be had for writing.
bool RemoveUnlessHeld(const fs::path& file) {
  const FileDescriptor descriptor(::open(file.c_str(), O_RDONLY | O_CLOEXEC));
  return descriptor.open() && ::flock(descriptor.get(), LOCK_EX | LOCK_NB) == 0 && ::unlink(file.c_str()) == 0;
}

}  // namespace

absl::StatusOr<ArtifactCache> ArtifactCache::Open(const fs::path& folder, std::int64_t limit) {
  ASSIGN_OR_RETURN(storage::ArtifactStore store, storage::ArtifactStore::Open(folder));
  return ArtifactCache(std::move(store), limit);
}

std::optional<ArtifactCache::Hold> ArtifactCache::HoldIfThere(const fs::path& file) const {
  // A file may be removed between its opening and its locking; its name may then stand for a new one.
  for (;;) {
    Hold hold(::open(file.c_str(), O_RDONLY | O_CLOEXEC));
    if (!hold.open()) return std::nullopt;
    struct stat info {};
    if (::flock(hold.get(), LOCK_SH) != 0 || ::fstat(hold.get(), &info) != 0) return std::nullopt;
    if (info.st_nlink == 0) continue;
    // Its time says when it was used last.
    (void)::futimens(hold.get(), nullptr);
    return hold;
  }
}

void ArtifactCache::MakeRoom(std::int64_t bytes) {
  const std::lock_guard lock(mutex_);
  std::vector<Kept> kept;
  Collect(store_.root() / "blobs", kept);
  Collect(store_.root() / "artifacts", kept);
  std::int64_t total = bytes;
  for (const Kept& file : kept) total += file.size;
  if (total <= limit_) return;
  std::sort(kept.begin(), kept.end(), [](const Kept& a, const Kept& b) { return a.used != b.used ? a.used < b.used : a.path < b.path; });
  for (const Kept& file : kept) {
    if (total <= limit_) return;
    if (RemoveUnlessHeld(file.path)) total -= file.size;
  }
}

}  // namespace vorocast::lease
