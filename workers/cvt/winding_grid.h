// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include "services/geometry/triangle_mesh.h"
#include "workers/cvt/marching_cubes.h"

namespace vorocast::cvt {

/// True when every edge is run through as often one way as the other, so that winding numbers are whole; edges may have four triangles.
bool IsWithoutBorder(const geometry::TriangleMesh& mesh);

/// The surface of the points around which a mesh without border winds at least once, cut from the grid: overlapping parts are united,
/// inverted ones left out. The grid must reach beyond the mesh on every side. Vertices lie on the mesh (within 5 % of a grid edge).
GridSurface CutWindingNumber(const geometry::TriangleMesh& mesh, const GridFrame& frame);

}  // namespace vorocast::cvt
