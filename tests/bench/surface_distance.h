// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <vector>

#include "services/geometry/triangle_mesh.h"

namespace vorocast::bench {

/// Distances of points to a surface, metres.
struct SurfaceDistances {
  double sum = 0, mean = 0, p95 = 0, max = 0;
};

/// Exact, by CGAL's AABB tree: nothing of what is judged takes part. All zero for no points or no triangle that has an area.
SurfaceDistances DistancesTo(const geometry::TriangleMesh& surface, const std::vector<geometry::Vec3>& points);

}  // namespace vorocast::bench
