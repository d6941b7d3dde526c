// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "services/base/status.h"
#include "services/capture/capture.h"
#include "services/geometry/oriented_points.h"

namespace vorocast::bench {

/// A take that the paper's measurements are repeated on.
struct PaperTake {
  std::string name;  // "synth", "kinoptic" or "crane"
  capture::Capture capture;
  std::filesystem::path truth;  // truth.h5 of the same frames, or empty where nobody knows
};

/// The takes that can be had here, `frames` frames of each: a made-up one, kinoptic (a real person, fuzzy, centimetres and y down), and crane's
/// meshes scanned by depth cameras (75,000 points, 1 mm noise). Made-up ones go into `scratch`. A capture that is absent is left out and said so.
absl::StatusOr<std::vector<PaperTake>> OpenPaperTakes(const std::filesystem::path& scratch, std::int32_t frames);

/// A frame of a take, metres and y up.
absl::StatusOr<geometry::OrientedPoints> ReadPoints(const PaperTake& take, std::size_t frame);

}  // namespace vorocast::bench
