// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <cstdint>
#include <vector>

#include "services/geometry/tracked_take.h"

namespace vorocast::geometry {

/// How a run of consecutive frames moves, told by the cells of one of them: the content of stretch.h5 (docs/storage_format.md). It knows nothing of
/// the take's template, so that every stretch of a take can be followed at once.
struct Stretch {
  std::int32_t frame = 0;           // whose cells these are
  std::vector<Vec3> centroid;       // [m] of its cells, metres
  std::vector<std::int32_t> patch;  // [m] patch of each cell, 0 … motion.patch_count−1
  PoseTrack motion;                 // the stretch's frames; poses are world_from_template with `frame`'s cells as the template
};

}  // namespace vorocast::geometry
