// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <filesystem>

#include "services/base/progress.h"
#include "services/base/status.h"
#include "services/interchange/moving_cells.h"

namespace vorocast::interchange {

enum class PointCache { kPc2, kMdd };

/// Writes a point cache (.pc2: little-endian, "POINTCACHE2"; .mdd: big-endian, with the instants' times) and beside it the mesh that it moves,
/// the same name with .obj: all cells' closed polyhedra, groups cell_00000 …, materials skin and cut, vertices in the cache's order.
/// Metres, y up. A cell that is gone shrinks to its centroid, because a cache cannot hide; copies (groups copy_000_cell_00000 …) and cells that turn
/// into another take's (pair_00000 …) are such points until they come. PC2 has one rate: the mean of the instants'. Scene objects are not in it.
/// RESOURCE_EXHAUSTED for more vertices or instants than the format counts; UNAVAILABLE when a file cannot be written.
absl::Status WritePointCache(const MovingCells& take, PointCache format, const std::filesystem::path& path, const base::Progress& progress);

}  // namespace vorocast::interchange
