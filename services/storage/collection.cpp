// SPDX-License-Identifier: AGPL-3.0-or-later
#include "services/storage/collection.h"

#include <fcntl.h>
#include <sys/stat.h>

#include <cerrno>
#include <cstring>
#include <mutex>
#include <optional>

#include <fmt/format.h>

namespace vorocast::storage {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kHexDigits = 64;
/// Between noting a use and removing what has not been used there is no gap.
std::mutex use_mutex;
/// A file that is used again and again is touched this often at most.
constexpr absl::Duration kNoteEvery = absl::Minutes(1);

fs::path Trash(const ArtifactStore& store) { return store.root() / "trash"; }

fs::path PathOf(const ArtifactStore& store, const StoredFile& file) {
  return file.what == StoredFile::What::kBlob ? store.BlobPath(file.digest, file.extension) : store.ArtifactPath(file.digest, file.extension);
}

/// Nothing for a file that is not there, or is none.
std::optional<struct stat> Look(const fs::path& path) {
  struct stat info {};
  if (::lstat(path.c_str(), &info) != 0 || !S_ISREG(info.st_mode)) return std::nullopt;
  return info;
}

absl::Status ListFolder(const fs::path& folder, StoredFile::What what, const std::function<bool()>& stop, std::vector<StoredFile>& files) {
  std::error_code error;
  for (fs::recursive_directory_iterator entry(folder, error), end; !error && entry != end && !stop(); entry.increment(error)) {
    const std::string name = entry->path().filename().string();
    if (name.size() <= kHexDigits || name[kHexDigits] != '.') continue;
    const auto digest = base::Digest::FromHex(name.substr(0, kHexDigits));
    const auto info = Look(entry->path());
    if (!digest.ok() || !info) continue;
    files.push_back({.what = what,
                     .digest = *digest,
                     .extension = name.substr(kHexDigits),
                     .size = info->st_size,
                     .used = absl::TimeFromTimespec(info->st_mtim)});
  }
  if (error) return absl::UnavailableError(fmt::format("{}: cannot be read: {}", folder.string(), error.message()));
  return absl::OkStatus();
}

}  // namespace

absl::StatusOr<std::vector<StoredFile>> ListStored(const ArtifactStore& store, const std::function<bool()>& stop) {
  std::vector<StoredFile> files;
  RETURN_IF_ERROR(ListFolder(store.root() / "blobs", StoredFile::What::kBlob, stop, files));
  RETURN_IF_ERROR(ListFolder(store.root() / "artifacts", StoredFile::What::kResult, stop, files));
  return files;
}

void NoteUse(const fs::path& path, absl::Time now) {
  const std::lock_guard lock(use_mutex);
  const auto info = Look(path);
  if (!info || now - absl::TimeFromTimespec(info->st_mtim) < kNoteEvery) return;
  const timespec times[2] = {absl::ToTimespec(now), absl::ToTimespec(now)};
  // Of a file that another user made this may be refused: it then counts as used when it was made.
  (void)::utimensat(AT_FDCWD, path.c_str(), times, AT_SYMLINK_NOFOLLOW);
}

absl::StatusOr<bool> Discard(const ArtifactStore& store, const StoredFile& file) {
  const fs::path path = PathOf(store, file);
  const std::lock_guard lock(use_mutex);
  const auto info = Look(path);
  if (!info || absl::TimeFromTimespec(info->st_mtim) != file.used) return false;
  std::error_code error;
  fs::create_directories(Trash(store), error);
  const fs::path gone = Trash(store) / path.filename();
  if (::rename(path.c_str(), gone.c_str()) != 0) {
    if (errno == ENOENT) return false;
    return absl::UnavailableError(fmt::format("{}: cannot be removed: {}", path.string(), std::strerror(errno)));
  }
  fs::remove(gone, error);
  if (error) return absl::UnavailableError(fmt::format("{}: cannot be removed: {}", gone.string(), error.message()));
  return true;
}

void EmptyTrash(const ArtifactStore& store) {
  std::error_code error;
  for (fs::directory_iterator entry(Trash(store), error), end; !error && entry != end; entry.increment(error)) {
    std::error_code ignored;
    fs::remove(entry->path(), ignored);
  }
}

}  // namespace vorocast::storage
