// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include "services/base/status.h"
#include "services/geometry/oriented_points.h"
#include "services/geometry/triangle_mesh.h"
#include "workers/cvt/indicator.h"

namespace vorocast::cvt {

/// A closed surface and the spacing of the grid it was cut from, which is the size of the smallest detail it can show.
struct ClosedSurface {
  geometry::TriangleMesh mesh;
  double spacing_m = 0;
};

/// The closed surface that oriented points describe; what ShapeFromPoints splits into solids. Shells that no points support are gone.
absl::StatusOr<ClosedSurface> SurfaceFromPoints(const geometry::OrientedPoints& points, const IndicatorOptions& options, IndicatorSummary* summary);

}  // namespace vorocast::cvt
