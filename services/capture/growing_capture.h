// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <map>
#include <string>
#include <vector>

#include "services/base/status.h"
#include "services/capture/capture.h"

namespace vorocast::capture {

/// A frame's file as it is found now.
struct FrameFile {
  CaptureFrame frame;
  std::uint64_t size = 0;
  std::filesystem::file_time_type written;
};

/// Decides which frames of a folder that a capture still writes to are whole. Frames leave in their order, each once.
class GrowingCapture {
 public:
  using Time = std::chrono::steady_clock::time_point;
  /// A file counts as whole once its size and time stayed as they are for `settle`, or ten times as long where `reads` says that it cannot be read:
  /// then it is left to the service to say what is wrong with it.
  struct Options {
    std::chrono::milliseconds settle{1000};
  };
  /// Whether a frame can be read as it is now.
  using Reads = std::function<bool(const std::filesystem::path&)>;

  GrowingCapture(const Options& options, Reads reads) : options_(options), reads_(std::move(reads)) {}

  /// The frames that have become whole, given the folder's frames in their order. ALREADY_EXISTS when a file sorts before one that has left:
  /// all numbers after it would mean other frames.
  absl::StatusOr<std::vector<CaptureFrame>> Next(const std::vector<FrameFile>& files, Time now);

  /// Frames that have left and whose file has changed since, each told once: what was taken was not whole.
  std::vector<std::filesystem::path> ChangedLater(const std::vector<FrameFile>& files);

  std::size_t left_count() const { return left_.size(); }
  /// Since when no file has appeared or changed; the first call of Next before any.
  Time last_change() const { return last_change_; }

 private:
  struct Seen {
    std::uint64_t size = 0;
    std::filesystem::file_time_type written;
    Time since;
    bool unreadable = false;
  };
  Options options_;
  Reads reads_;
  std::map<std::filesystem::path, Seen> waiting_;
  std::vector<FrameFile> left_;
  bool started_ = false;
  Time last_change_{};
};

/// The capture's frames with their files' sizes and times. A file that vanishes meanwhile is left out with all after it.
std::vector<FrameFile> FilesOf(const Capture& capture);

}  // namespace vorocast::capture
