// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "services/geometry/cells.h"
#include "services/geometry/triangle_mesh.h"

namespace vorocast::bench {

/// What a mesher gives: tetrahedra with positive volume.
struct Tetrahedra {
  std::vector<geometry::Vec3> vertices;
  std::vector<std::array<std::int32_t, 4>> tetrahedra;
};

/// Tetrahedra as cells, so that what scores cells scores them: the site of each is its centroid, which gives them the least energy they can have.
geometry::Cells CellsOf(const Tetrahedra& mesh);

/// The faces of cells that have no neighbour, as triangles.
geometry::TriangleMesh SurfaceOf(const geometry::Cells& cells);

}  // namespace vorocast::bench
