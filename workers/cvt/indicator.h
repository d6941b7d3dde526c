// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include "services/base/status.h"
#include "services/geometry/oriented_points.h"
#include "services/geometry/triangle_mesh.h"
#include "workers/cvt/shape.h"

namespace vorocast::cvt {

enum class IndicatorMethod { kSpectral, kCgal };

struct IndicatorOptions {
  IndicatorMethod method = IndicatorMethod::kSpectral;
  /// Grid spacing in metres; 0 chooses it from the points' density and extent (about 8 mm for a person), bounded by grid_nodes_max.
  double spacing_m = 0;
  std::int64_t grid_nodes_max = 8'000'000;
  /// Gaussian that smooths the splatted normals, in grid cells.
  double smoothing_cells = 0.5;

  absl::Status Validate() const;
};

struct IndicatorSummary {
  double spacing_m = 0;
  double seconds_solve = 0;                // CPU time of the Poisson solve alone
  double distance_mean_m = 0;              // of the input points to the surface; a point farther than 5 spacings counts as 5
  std::int64_t points_dropped_shells = 0;  // points whose shell was too small or too little supported to keep
  std::int64_t points_far = 0;             // points more than 2 spacings from the surface: on parts too thin for the grid, stray, or inside
};

/// The shape that oriented points describe: a Poisson indicator (paper, section 3; Kazhdan 2006; spectral solve as in Peng 2021),
/// isovalue at the points' mean, meshed closed. INVALID_ARGUMENT when the points cannot bound a volume, with the reason.
absl::StatusOr<Shape> ShapeFromPoints(const geometry::OrientedPoints& points, const IndicatorOptions& options, IndicatorSummary* summary);

/// The shape a mesh bounds. A closed mesh that does not cross itself is taken as it is. One without border that crosses itself, or has edges with
/// four triangles, is cut anew from a grid where its winding number is positive: overlapping parts are united. One with holes is resampled to
/// points and goes the way of points. INVALID_ARGUMENT when it encloses no volume, faces inward, or is broken.
absl::StatusOr<Shape> ShapeFromMesh(const geometry::TriangleMesh& mesh, const IndicatorOptions& options, IndicatorSummary* summary);

}  // namespace vorocast::cvt
