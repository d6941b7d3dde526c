// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <cstdint>
#include <filesystem>
#include <vector>

#include "services/base/status.h"
#include "services/geometry/vector.h"

namespace vorocast::storage {

/// Where fixed material points of a made-up capture's surface are in every frame: what a tracked take is held against.
/// In the file: /points [F,k,3] f8 (metres, y up), /part [k] i4, root attribute frames_per_second f8.
struct Truth {
  double frames_per_second = 25;
  std::vector<std::int32_t> part;                   // [k], what each point belongs to; the capture's maker says what the numbers mean
  std::vector<std::vector<geometry::Vec3>> points;  // [F][k]
};

/// Writes the same bytes for the same content. INVALID_ARGUMENT when a frame has not one point for each part.
absl::Status WriteTruth(const std::filesystem::path& path, const Truth& truth);
/// Checks every shape against the file's size before memory is taken. NOT_FOUND, or DATA_LOSS with file, dataset and reason.
absl::StatusOr<Truth> ReadTruth(const std::filesystem::path& path);

}  // namespace vorocast::storage
