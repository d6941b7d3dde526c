// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>

#include "services/base/status.h"
#include "services/geometry/oriented_points.h"

namespace vorocast::synth {

/// What capture.json says, in metres and y up.
struct CaptureDescription {
  std::string name;
  double frames_per_second = 25;
  std::int32_t components = 0;
};

/// Creates `folder` if need be. ALREADY_EXISTS when it holds anything, for frames of two takes would mix.
absl::Status PrepareFolder(const std::filesystem::path& folder);
/// frame_0000.ply; as many digits as keep the names sorted.
std::string FrameName(std::int32_t frame);
/// Binary little endian: float x y z nx ny nz, uchar red green blue when there are colours.
absl::Status WritePly(const std::filesystem::path& path, const geometry::OrientedPoints& points);
absl::Status WriteDescription(const std::filesystem::path& path, const CaptureDescription& description);

}  // namespace vorocast::synth
