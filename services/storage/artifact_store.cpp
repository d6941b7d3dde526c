// SPDX-License-Identifier: AGPL-3.0-or-later
#include "services/storage/artifact_store.h"

#include <fcntl.h>
#include <signal.h>
#include <sys/stat.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <chrono>
#include <cstring>
#include <random>
#include <string>
#include <system_error>

#include <fmt/format.h>

namespace vorocast::storage {
namespace {

namespace fs = std::filesystem;

absl::Status Unavailable(const fs::path& path, std::string_view what, const std::string& why) {
  return absl::UnavailableError(fmt::format("{}: {}: {}; check that the artifact folder is there, writable and not full", path.string(), what, why));
}

absl::Status Unavailable(const fs::path& path, std::string_view what) { return Unavailable(path, what, std::strerror(errno)); }

/// Makes a file's bytes, or a folder's entries, survive a power cut.
absl::Status Sync(const fs::path& path) {
  const int file = ::open(path.c_str(), O_RDONLY | O_CLOEXEC);
  if (file < 0) return Unavailable(path, "cannot be opened to be made durable");
  const int result = ::fsync(file);
  const int reason = errno;
  ::close(file);
  // Some file systems cannot sync a folder and say so with EINVAL; they order the rename themselves.
  if (result != 0 && reason != EINVAL) return Unavailable(path, "cannot be made durable", std::strerror(reason));
  return absl::OkStatus();
}

absl::Status MakeFolder(const fs::path& folder) {
  std::error_code error;
  if (fs::is_directory(folder, error)) return absl::OkStatus();
  fs::create_directories(folder, error);
  if (error) return Unavailable(folder, "the folder cannot be made", error.message());
  return Sync(folder.parent_path());
}

/// Gives `temporary` the name `target` unless that exists, in which case `temporary` is removed: whoever was first stays.
absl::Status MoveUnlessThere(const fs::path& temporary, const fs::path& target) {
  if (::link(temporary.c_str(), target.c_str()) == 0 || errno == EEXIST) {
    ::unlink(temporary.c_str());
    return absl::OkStatus();
  }
  // A file system without hard links: replacing is as good, because two results of one name have the same content.
  if (errno != EPERM && errno != EOPNOTSUPP && errno != ENOSYS && errno != EMLINK) return Unavailable(target, "cannot be put in place");
  if (::rename(temporary.c_str(), target.c_str()) != 0) return Unavailable(target, "cannot be put in place");
  return absl::OkStatus();
}

absl::Status Publish(const fs::path& temporary, const fs::path& target) {
  RETURN_IF_ERROR(MakeFolder(target.parent_path()));
  // Readable by all, whatever the writer's umask: other users' jobs reuse results. Never writable again.
  if (::chmod(temporary.c_str(), 0444) != 0) return Unavailable(temporary, "cannot be made read-only");
  RETURN_IF_ERROR(Sync(temporary));
  RETURN_IF_ERROR(MoveUnlessThere(temporary, target));
  return Sync(target.parent_path());
}

std::string HostName() {
  char name[256] = {};
  if (::gethostname(name, sizeof(name) - 1) != 0) return "unknown";
  return name;
}

fs::path FileIn(const fs::path& folder, const base::Digest& digest, std::string_view extension) {
  const std::string hex = digest.Hex();
  return folder / hex.substr(0, 2) / (hex + std::string(extension));
}

bool IsFile(const fs::path& path) {
  std::error_code error;
  return fs::is_regular_file(path, error);
}

}  // namespace

absl::StatusOr<ArtifactStore> ArtifactStore::Open(const fs::path& root) {
  std::error_code error;
  const fs::path absolute = fs::absolute(root, error).lexically_normal();
  if (error) return Unavailable(root, "is not a path", error.message());
  for (const char* folder : {"blobs", "artifacts", "tmp"}) RETURN_IF_ERROR(MakeFolder(absolute / folder));
  return ArtifactStore(absolute);
}

fs::path ArtifactStore::BlobPath(const base::Digest& digest, std::string_view extension) const { return FileIn(root_ / "blobs", digest, extension); }

fs::path ArtifactStore::ArtifactPath(const base::Digest& key, std::string_view extension) const {
  return FileIn(root_ / "artifacts", key, extension);
}

bool ArtifactStore::HasBlob(const base::Digest& digest, std::string_view extension) const { return IsFile(BlobPath(digest, extension)); }

bool ArtifactStore::HasArtifact(const base::Digest& key, std::string_view extension) const { return IsFile(ArtifactPath(key, extension)); }

fs::path ArtifactStore::TemporaryPath(std::string_view extension) const {
  static const std::uint64_t process_tag = (std::uint64_t{std::random_device()()} << 32) | std::random_device()();
  static std::atomic<std::uint64_t> counter = 0;
  return root_ / "tmp" / fmt::format("{}.{}.{:016x}.{}{}", HostName(), ::getpid(), process_tag, counter++, extension);
}

absl::Status ArtifactStore::PublishArtifact(const fs::path& temporary, const base::Digest& key, std::string_view extension) const {
  return Publish(temporary, ArtifactPath(key, extension));
}

absl::Status ArtifactStore::PublishBlob(const fs::path& temporary, const base::Digest& digest, std::string_view extension) const {
  ASSIGN_OR_RETURN(const base::Digest actual, base::HashFile(temporary));
  if (actual != digest) {
    return absl::DataLossError(
        fmt::format("{}: the bytes have digest {}, not {}; send the file again", temporary.string(), actual.Hex(), digest.Hex()));
  }
  return Publish(temporary, BlobPath(digest, extension));
}

std::int64_t ArtifactStore::RemoveStaleTemporaries(absl::Duration minimum_age) const {
  std::int64_t removed = 0;
  std::error_code error;
  const std::string own_host = HostName() + ".";
  for (fs::directory_iterator entry(root_ / "tmp", error), end; !error && entry != end; entry.increment(error)) {
    const std::string name = entry->path().filename().string();
    if (!name.starts_with(own_host)) continue;
    const long pid = std::strtol(name.c_str() + own_host.size(), nullptr, 10);
    const bool writer_is_gone = pid > 0 && ::kill(static_cast<pid_t>(pid), 0) != 0 && errno == ESRCH;
    std::error_code age_error;
    const auto age = fs::file_time_type::clock::now() - entry->last_write_time(age_error);
    if (writer_is_gone && !age_error && absl::FromChrono(age) >= minimum_age && fs::remove(entry->path(), age_error)) ++removed;
  }
  return removed;
}

}  // namespace vorocast::storage
