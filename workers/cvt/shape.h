// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <cstdint>
#include <vector>

#include "services/base/status.h"
#include "services/geometry/oriented_points.h"
#include "services/geometry/triangle_mesh.h"

namespace vorocast::cvt {

/// The volume Ω to be tessellated: the solid inside a closed, outward-oriented, edge-manifold triangle mesh (paper, section 3.2: S is given
/// by an indicator function; here the indicator's zero set is meshed once, so that clipping, volumes and moments are exact for it).
struct Shape {
  geometry::TriangleMesh surface;                // closed: geometry::IsClosed
  std::vector<std::int32_t> triangle_component;  // [triangles] connected solid each triangle bounds, 0 … component_count−1, largest volume first
  std::int32_t component_count = 0;
  std::vector<double> component_volume;  // [component_count] m³, positive; cavities subtracted
};

/// Splits a closed mesh into solids: each outer shell with the cavities inside it. Drops shells smaller than `volume_min` m³.
absl::StatusOr<Shape> ShapeFromSurface(geometry::TriangleMesh surface, double volume_min);

}  // namespace vorocast::cvt
