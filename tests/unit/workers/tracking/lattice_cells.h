// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include "services/geometry/cells.h"
#include "services/geometry/triangle_mesh.h"

namespace vorocast::tracking {

/// Cells for tests, made without the tessellator: the cubes of a lattice whose centres lie inside a closed mesh. Faces between cubes join neighbours;
/// the mesh's own triangles are the surface faces, each of the nearest cube. Volumes are whole cubes; depth is the distance to the nearest mesh
/// vertex.
geometry::Cells LatticeCells(const geometry::TriangleMesh& mesh, double spacing_m, const geometry::Vec3& offset);

}  // namespace vorocast::tracking
