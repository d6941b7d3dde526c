// SPDX-License-Identifier: AGPL-3.0-or-later
#include "services/lease/input_check.h"

#include <sys/stat.h>

#include <cerrno>
#include <cstring>
#include <filesystem>
#include <optional>

#include <fmt/format.h>

#include "services/base/digest.h"

namespace vorocast::lease {
namespace {

/// More than a long take has files; beyond it everything is simply read once more.
constexpr std::size_t kRemembered = 100'000;

std::int64_t Nanoseconds(const timespec& time) { return std::int64_t{time.tv_sec} * 1'000'000'000 + time.tv_nsec; }

}  // namespace

absl::StatusOr<InputCheck::Stamp> InputCheck::StampOf(const std::string& path) {
  struct stat facts {};
  if (stat(path.c_str(), &facts) != 0) return absl::NotFoundError(fmt::format("{}: {}", path, std::strerror(errno)));
  return Stamp{facts.st_ino, facts.st_size, Nanoseconds(facts.st_mtim), Nanoseconds(facts.st_ctim)};
}

absl::Status InputCheck::CheckFile(const std::string& path, const base::Digest& expected) {
  ASSIGN_OR_RETURN(const Stamp stamp, StampOf(path));
  {
    const std::lock_guard lock(mutex_);
    if (const auto found = right_.find(path); found != right_.end() && found->second == stamp) return absl::OkStatus();
  }
  ASSIGN_OR_RETURN(const base::Digest digest, base::HashFile(path));
  if (digest != expected) {
    return absl::DataLossError(
        fmt::format("{}: its bytes are not those that were stored ({} instead of {})", path, digest.Short(), expected.Short()));
  }
  const std::lock_guard lock(mutex_);
  if (right_.size() >= kRemembered) right_.clear();
  right_[path] = stamp;
  return absl::OkStatus();
}

absl::Status InputCheck::Check(const tasks::TaskSpec& spec, const storage::ArtifactStore& store, Files files) {
  for (const tasks::Input& input : spec.inputs) {
    const bool is_blob = input.source == tasks::Input::Source::kBlob;
    const std::optional<base::Digest>& expected = is_blob ? input.digest : input.content;
    if (!input.digest || !expected) continue;
    const std::string path = is_blob ? store.BlobPath(*input.digest, input.extension) : store.ArtifactPath(*input.digest, input.extension);
    const absl::Status status = CheckFile(path, *expected);
    if (!absl::IsDataLoss(status)) {
      RETURN_IF_ERROR(status);
    } else if (files == Files::kCopies) {
      std::error_code ignored;
      std::filesystem::remove(path, ignored);
      return base::Annotate(status, "a copy was damaged in this worker's cache and has been removed; the next attempt brings it anew");
    } else if (is_blob) {
      return base::Annotate(status, "a captured frame is damaged in the store; remove the file and send the take again");
    } else {
      return base::Annotate(status, "a result is damaged in the store; 'vorocast retry' of the job makes it anew");
    }
  }
  return absl::OkStatus();
}

}  // namespace vorocast::lease
