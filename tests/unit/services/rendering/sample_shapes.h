// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <cstdint>

#include "services/geometry/cells.h"
#include "services/geometry/triangle_mesh.h"

namespace vorocast::rendering::testing {

/// A block of nx × ny × nz cubic cells of the given side, standing on y = 0 around the origin; shared vertices, quadrilateral faces.
geometry::Cells CubeCells(std::int32_t nx, std::int32_t ny, std::int32_t nz, double side);

/// A sphere of triangles, `rings` from pole to pole.
geometry::TriangleMesh SphereMesh(double radius, std::int32_t rings);

}  // namespace vorocast::rendering::testing
