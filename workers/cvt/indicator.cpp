// SPDX-License-Identifier: AGPL-3.0-or-later
#include "workers/cvt/indicator.h"

#include <cmath>

#include "workers/cvt/surface_from_mesh.h"
#include "workers/cvt/surface_from_points.h"

namespace vorocast::cvt {
namespace {

/// Solids below this many grid cells are noise of the grid.
constexpr double kSmallestSolidCells = 30;

absl::StatusOr<Shape> SplitIntoSolids(ClosedSurface surface) {
  return ShapeFromSurface(std::move(surface.mesh), kSmallestSolidCells * std::pow(surface.spacing_m, 3));
}

}  // namespace

absl::StatusOr<Shape> ShapeFromPoints(const geometry::OrientedPoints& points, const IndicatorOptions& options, IndicatorSummary* summary) {
  ASSIGN_OR_RETURN(ClosedSurface surface, SurfaceFromPoints(points, options, summary));
  return SplitIntoSolids(std::move(surface));
}

absl::StatusOr<Shape> ShapeFromMesh(const geometry::TriangleMesh& mesh, const IndicatorOptions& options, IndicatorSummary* summary) {
  ASSIGN_OR_RETURN(ClosedSurface surface, SurfaceFromMesh(mesh, options, summary));
  return SplitIntoSolids(std::move(surface));
}

}  // namespace vorocast::cvt
