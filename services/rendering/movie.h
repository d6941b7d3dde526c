// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <sys/types.h>

#include <cstdint>
#include <filesystem>
#include <memory>

#include "services/base/status.h"
#include "services/rendering/sheet.h"

namespace vorocast::rendering {

/// Writes pictures as a movie: H.264 in MP4, 4:2:0, BT.709, to be looked at in any player. The ffmpeg program does it, single-threaded and without
/// anything that differs from run to run, so that the same pictures give the same bytes.
class MovieWriter {
 public:
  /// Pictures of this size follow; a side that is odd gets one more row or column. FAILED_PRECONDITION when ffmpeg is not installed;
  /// INVALID_ARGUMENT for a size or rate that no movie has. From here on the process ignores SIGPIPE: a dead ffmpeg is an error, not an end.
  static absl::StatusOr<MovieWriter> Open(const std::filesystem::path& path, std::int32_t width, std::int32_t height, double frames_per_second);
  MovieWriter(MovieWriter&&) noexcept;
  MovieWriter& operator=(MovieWriter&&) = delete;
  /// Without Finish the movie is abandoned.
  ~MovieWriter();

  /// INTERNAL when ffmpeg has ended; what it said is on standard error.
  absl::Status Add(const Image& image);
  absl::Status Finish();

 private:
  MovieWriter(pid_t pid, int pipe, std::int32_t width, std::int32_t height) : pid_(pid), pipe_(pipe), width_(width), height_(height) {}
  absl::Status Wait();

  pid_t pid_ = -1;
  int pipe_ = -1;
  std::int32_t width_ = 0;
  std::int32_t height_ = 0;
};

}  // namespace vorocast::rendering
