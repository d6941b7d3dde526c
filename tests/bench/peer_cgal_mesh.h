// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <cstddef>

#include "services/base/status.h"
#include "services/geometry/triangle_mesh.h"
#include "tests/bench/tetrahedra.h"

namespace vorocast::bench {

/// CGAL's Delaunay refinement (Mesh_3, make_mesh_3) of the solid inside a closed surface, at its defaults of optimisation. No Delaunay ball, of
/// surface triangles as of tetrahedra, has a larger radius than `ball_radius_m`. INTERNAL on a CGAL error.
absl::StatusOr<Tetrahedra> CgalDelaunayRefinement(const geometry::TriangleMesh& surface, double ball_radius_m);

}  // namespace vorocast::bench
