// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include "services/geometry/triangle_mesh.h"
#include "workers/cvt/field_grid.h"
#include "workers/cvt/sorted_points.h"

namespace vorocast::cvt {

/// Moves the vertices of a surface along its normals onto a moving least squares fit of the points around them, which takes back the
/// smoothing and the shrinking of thin parts that the grid caused. A vertex moves only as far as points that face the same way support it,
/// never more than `step_max`; connectivity stays. Lengths in grid cells.
struct SurfaceFitOptions {
  float radius = 1.75F;  // of the points that count for a vertex
  float step_max = 0.7F;
  int rounds = 2;
};
void FitSurface(const SortedPoints& points, const GridFrame& frame, const SurfaceFitOptions& options, geometry::TriangleMesh& mesh);

}  // namespace vorocast::cvt
