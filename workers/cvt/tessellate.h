// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <string>

#include "services/base/progress.h"
#include "services/base/status.h"
#include "services/geometry/cells.h"
#include "workers/cvt/shape.h"

namespace vorocast::cvt {

enum class Start { kLattice, kRandom };
/// Where a cell's candidate neighbours come from: the neighbour grid, or TetGen's Delaunay edges as the reference it is tested against.
enum class Neighbours { kGrid, kTetGen };

struct TessellateOptions {
  std::int32_t cells = 5000;     // n, 1 … 200000; shared between components by volume, at least one each
  std::int32_t iterations = 10;  // of L-BFGS
  Start start = Start::kLattice;
  Neighbours neighbours = Neighbours::kGrid;
  std::uint64_t seed = 1;

  absl::Status Validate() const;
};

struct TessellateSummary {
  std::int32_t iterations = 0;
  std::int32_t evaluations = 0;  // of the clipped energy and gradient
  double energy_start = 0;
  double energy = 0;         // E, m⁵
  double gradient_norm = 0;  // at the end
  double second_moment = 0;  // G3
  double volume_error = 0;   // |Σ cell volumes − shape volume| / shape volume
  std::string why_stopped;   // "iterations", "gradient", "no progress"
};

/// Centroidal Voronoi cells of a shape (paper, section 3): starting sites, Voronoi cells clipped exactly at the surface, L-BFGS on the CVT energy.
/// Fills every field of Cells but `surface`. Deterministic in (shape, options).
absl::StatusOr<geometry::Cells> Tessellate(const Shape& shape, const TessellateOptions& options, TessellateSummary* summary,
                                           const base::Progress& progress);

/// Moments of the clipped Voronoi cells of given sites, for tests, benchmarks and the optimiser.
struct ClippedMoments {
  std::vector<double> volume;            // [n]
  std::vector<geometry::Vec3> centroid;  // [n]
  std::vector<double> second_moment;     // [n] ∫ |x − site|² over the cell
  double energy = 0;                     // Σ second_moment
  std::vector<geometry::Vec3> gradient;  // [n] 2 volume (site − centroid)
};
absl::StatusOr<ClippedMoments> EvaluateClippedCells(const Shape& shape, const std::vector<geometry::Vec3>& sites, Neighbours neighbours);

}  // namespace vorocast::cvt
