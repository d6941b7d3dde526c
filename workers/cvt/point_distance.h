// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <cstdint>
#include <vector>

#include "workers/cvt/marching_cubes.h"
#include "workers/cvt/sorted_points.h"

namespace vorocast::cvt {

/// How points lie to a surface that was cut out of the same grid.
struct PointSurfaceDistances {
  std::vector<float> distance;         // [points] in grid cells, at most kFarthestCells
  std::vector<std::int32_t> triangle;  // [points] the nearest one, or −1 beyond kFarthestCells
};
inline constexpr float kFarthestCells = 5;

/// Searches the cells around each point, so the surface's vertices may have moved by up to a cell since it was cut, no more.
PointSurfaceDistances DistancesToSurface(const SortedPoints& points, const GridFrame& frame, const GridSurface& surface);

}  // namespace vorocast::cvt
