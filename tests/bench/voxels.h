// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include "services/geometry/cells.h"
#include "services/geometry/triangle_mesh.h"

namespace vorocast::bench {

/// A shape on a regular grid, as the paper's Table 1 has it.
struct Voxels {
  geometry::Cells cubes;           // those that intersect the shape (one corner inside at least) or lie in it, whole
  geometry::TriangleMesh surface;  // marching cubes, crossings of the grid's edges exact
};

/// Voxels of the solid inside a closed surface.
Voxels MakeVoxels(const geometry::TriangleMesh& solid, double edge_m);

}  // namespace vorocast::bench
