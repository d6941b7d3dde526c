// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <cstdint>
#include <vector>

#include "services/base/status.h"
#include "services/geometry/vector.h"

namespace vorocast::cvt {

/// The neighbours of every point in TetGen's Delaunay tetrahedrisation, sorted: every Voronoi neighbour is among them.
/// INVALID_ARGUMENT with TetGen's reason when there is none (fewer than four points, or all in one plane).
absl::StatusOr<std::vector<std::vector<std::int32_t>>> DelaunayNeighbours(const std::vector<geometry::Vec3>& points);

}  // namespace vorocast::cvt
