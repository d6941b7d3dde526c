// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <cstddef>

#include "services/base/status.h"
#include "services/geometry/triangle_mesh.h"
#include "tests/bench/tetrahedra.h"

namespace vorocast::bench {

/// CGAL's Delaunay refinement (Mesh_3, make_mesh_3) of the solid inside a closed surface, at its defaults of optimisation. No Delaunay ball, of
/// surface triangles as of tetrahedra, is wider than `ball_diameter_m` (the paper, section 3.3: the diagonal of a voxel). INTERNAL on a CGAL error.
absl::StatusOr<Tetrahedra> CgalDelaunayRefinement(const geometry::TriangleMesh& surface, double ball_diameter_m);

}  // namespace vorocast::bench
