// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include "services/base/status.h"
#include "services/geometry/triangle_mesh.h"
#include "workers/cvt/surface_from_points.h"

namespace vorocast::cvt {

/// The closed surface of the solid a mesh bounds; what ShapeFromMesh splits into solids.
///  - A closed mesh that does not cross itself is its own answer.
///  - A mesh without borders that crosses itself, or has edges with more than two triangles, is cut anew from a grid: inside is where
///    its winding number is positive, and the crossings of the grid's edges are exact.
///  - A mesh with holes is sampled and goes the way of points.
absl::StatusOr<ClosedSurface> SurfaceFromMesh(const geometry::TriangleMesh& mesh, const IndicatorOptions& options, IndicatorSummary* summary);

}  // namespace vorocast::cvt
