// SPDX-License-Identifier: AGPL-3.0-or-later
#include "services/capture/growing_capture.h"

#include <algorithm>
#include <utility>

#include <fmt/format.h>

namespace vorocast::capture {
namespace {

/// How much longer a file that cannot be read is given: its writer may have paused.
constexpr int kPatience = 10;
/// So many of the last frames are looked at again after they have left.
constexpr std::size_t kLookedAtAgain = 50;

bool IsSame(const FrameFile& a, const FrameFile& b) { return a.size == b.size && a.written == b.written; }

}  // namespace

absl::StatusOr<std::vector<CaptureFrame>> GrowingCapture::Next(const std::vector<FrameFile>& files, Time now) {
  if (!std::exchange(started_, true)) last_change_ = now;
  for (std::size_t i = 0; i < std::min(files.size(), left_.size()); ++i) {
    if (files[i].frame.path == left_[i].frame.path) continue;
    return absl::AlreadyExistsError(
        fmt::format("{}: its name sorts before or replaces that of frame {}, {}, which has been sent already. Frames are numbered in the order of "
                    "their names: give the take another --name and send it anew, or move this file away",
                    files[i].frame.path.string(), left_[i].frame.number, left_[i].frame.path.filename().string()));
  }

  std::vector<CaptureFrame> whole;
  bool in_order = true;  // every frame before has left
  for (std::size_t i = left_.size(); i < files.size(); ++i) {
    const FrameFile& file = files[i];
    const auto [found, is_new] = waiting_.try_emplace(file.frame.path, Seen{file.size, file.written, now});
    Seen& seen = found->second;
    if (is_new || seen.size != file.size || seen.written != file.written) {
      seen = {file.size, file.written, now};
      last_change_ = now;
    }
    const auto settled = now - seen.since;
    if (!in_order || settled < options_.settle) {
      in_order = false;
      continue;
    }
    if (!seen.unreadable) seen.unreadable = !reads_(file.frame.path);
    if (seen.unreadable && settled < kPatience * options_.settle) {
      in_order = false;
      continue;
    }
    whole.push_back(file.frame);
    left_.push_back(file);
    waiting_.erase(found);
  }
  return whole;
}

std::vector<std::filesystem::path> GrowingCapture::ChangedLater(const std::vector<FrameFile>& files) {
  std::vector<std::filesystem::path> changed;
  const std::size_t count = std::min(files.size(), left_.size());
  for (std::size_t i = count - std::min(count, kLookedAtAgain); i < count; ++i) {
    if (files[i].frame.path != left_[i].frame.path || IsSame(files[i], left_[i])) continue;
    changed.push_back(files[i].frame.path);
    left_[i] = files[i];
  }
  return changed;
}

std::vector<FrameFile> FilesOf(const Capture& capture) {
  std::vector<FrameFile> files;
  for (const CaptureFrame& frame : capture.frames) {
    std::error_code size_error, time_error;
    const auto size = std::filesystem::file_size(frame.path, size_error);
    const auto written = std::filesystem::last_write_time(frame.path, time_error);
    if (size_error || time_error) break;
    files.push_back({frame, size, written});
  }
  return files;
}

}  // namespace vorocast::capture
