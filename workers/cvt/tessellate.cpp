// SPDX-License-Identifier: AGPL-3.0-or-later
#include "workers/cvt/tessellate.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include "workers/cvt/clipped_cells.h"
#include "workers/cvt/optimise.h"
#include "workers/cvt/polyhedra.h"
#include "workers/cvt/solid.h"
#include "workers/cvt/starts.h"
#include "workers/cvt/triangle_tree.h"
#include "workers/cvt/x_rays.h"

namespace vorocast::cvt {
namespace {

using geometry::Vec3;

constexpr std::int32_t kCellsMax = 200'000;

absl::Status CheckShape(const Shape& shape) {
  if (shape.component_count < 1 || shape.component_volume.size() != static_cast<std::size_t>(shape.component_count) ||
      shape.triangle_component.size() != shape.surface.triangles.size() || shape.surface.triangles.empty()) {
    return absl::InvalidArgumentError("the shape has no solid, or its arrays disagree; make shapes by ShapeFromSurface");
  }
  for (std::size_t c = 0; c < shape.component_volume.size(); ++c) {
    if (!(shape.component_volume[c] > 0)) {
      return absl::InvalidArgumentError(fmt::format("solid {} has volume {} m³; it must be positive", c, shape.component_volume[c]));
    }
  }
  return absl::OkStatus();
}

/// Shares cells between solids by volume: one each, the rest by largest remainder, ties to the larger solid.
std::vector<std::int32_t> ShareCells(const std::vector<double>& volume, std::int32_t cells) {
  const double total = std::accumulate(volume.begin(), volume.end(), 0.0);
  std::vector<std::int32_t> share;
  std::vector<double> remainder;
  for (double v : volume) {
    const double exact = cells * (v / total);
    share.push_back(std::max(1, static_cast<std::int32_t>(exact)));
    remainder.push_back(exact - share.back());
  }
  for (std::int32_t left = cells - std::accumulate(share.begin(), share.end(), 0); left != 0;) {
    if (left > 0) {
      const auto c = std::ranges::max_element(remainder) - remainder.begin();
      ++share[c], --remainder[c], --left;
      continue;
    }
    // Ones for the smallest solids may have overdrawn: those who got the most above their due give back.
    std::size_t from = share.size();
    for (std::size_t c = 0; c < share.size(); ++c) {
      if (share[c] > 1 && (from == share.size() || remainder[c] < remainder[from])) from = c;
    }
    --share[from], ++remainder[from], ++left;
  }
  return share;
}

/// The largest of which solid each site lies in, or the nearest solid where it lies in none.
std::vector<std::int32_t> SolidOfSites(const std::vector<Solid>& solids, const std::vector<Vec3>& sites) {
  std::vector<std::int32_t> solid_of(sites.size(), solids.size() == 1 ? 0 : -1);
  if (solids.size() == 1) return solid_of;
  for (std::size_t c = 0; c < solids.size(); ++c) {
    const XRays rays(solids[c].vertices, solids[c].triangles);
    for (std::size_t i = 0; i < sites.size(); ++i) {
      if (solid_of[i] < 0 && rays.Inside(sites[i])) solid_of[i] = static_cast<std::int32_t>(c);
    }
  }
  if (std::ranges::find(solid_of, -1) == solid_of.end()) return solid_of;
  std::vector<double> best(sites.size(), std::numeric_limits<double>::infinity());
  std::vector<std::int32_t> nearest(sites.size(), 0);
  for (std::size_t c = 0; c < solids.size(); ++c) {
    const TriangleTree tree(solids[c].vertices, solids[c].triangles);
    for (std::size_t i = 0; i < sites.size(); ++i) {
      if (solid_of[i] >= 0) continue;
      const double distance = tree.Distance(sites[i]);
      if (distance < best[i]) best[i] = distance, nearest[i] = static_cast<std::int32_t>(c);
    }
  }
  for (std::size_t i = 0; i < sites.size(); ++i) {
    if (solid_of[i] < 0) solid_of[i] = nearest[i];
  }
  return solid_of;
}

std::vector<Solid> SolidsOf(const Shape& shape) {
  std::vector<Solid> solids;
  for (std::int32_t c = 0; c < shape.component_count; ++c) solids.push_back(SolidOf(shape, c));
  return solids;
}

/// Tessellates one solid and appends its cells.
absl::StatusOr<OptimiseSummary> TessellateSolid(const Solid& solid, std::int32_t component, std::int32_t count, const TessellateOptions& options,
                                                const base::Progress& progress, geometry::Cells* cells) {
  const std::uint64_t seed = options.seed + 0x9e3779b97f4a7c15ULL * static_cast<std::uint64_t>(component);
  std::vector<Vec3> sites = options.start == Start::kLattice ? LatticeSites(solid, count, seed) : RandomSites(solid, count, seed);
  ClippedCells clipped(solid, options.neighbours);
  ClippedComplex complex;
  ASSIGN_OR_RETURN(OptimiseSummary summary, Optimise(solid, options.iterations, &clipped, &sites, &complex, progress));
  const std::size_t first = cells->size();
  RETURN_IF_ERROR(AppendPolyhedra(clipped, complex, cells));
  const TriangleTree tree(solid.vertices, solid.triangles);
  // No point is deeper than its neighbour in the list by more than the way between them.
  double bound = std::numeric_limits<double>::infinity();
  for (std::size_t i = first; i < cells->size(); ++i) {
    if (i > first) bound = 1.000001 * (cells->depth.back() + (cells->centroid[i] - cells->centroid[i - 1]).norm());
    cells->depth.push_back(tree.Distance(cells->centroid[i], bound));
  }
  cells->component.resize(cells->size(), component);
  return summary;
}

}  // namespace

absl::Status TessellateOptions::Validate() const {
  if (cells < 1 || cells > kCellsMax) return absl::InvalidArgumentError(fmt::format("cells is {}; it must be 1 … {}", cells, kCellsMax));
  if (iterations < 0 || iterations > 10000) return absl::InvalidArgumentError(fmt::format("iterations is {}; it must be 0 … 10000", iterations));
  return absl::OkStatus();
}

absl::StatusOr<geometry::Cells> Tessellate(const Shape& shape, const TessellateOptions& options, TessellateSummary* summary,
                                           const base::Progress& progress) {
  RETURN_IF_ERROR(options.Validate());
  RETURN_IF_ERROR(CheckShape(shape));
  if (options.cells < shape.component_count) {
    return absl::InvalidArgumentError(fmt::format(
        "{} cells for {} separate solids; each needs at least one, so ask for more or drop the small solids", options.cells, shape.component_count));
  }
  geometry::Cells cells;
  TessellateSummary total;
  total.why_stopped = "iterations";
  const std::vector<Solid> solids = SolidsOf(shape);
  const std::vector<std::int32_t> share = ShareCells(shape.component_volume, options.cells);
  double gradient_squared = 0;
  double done = 0;
  for (std::size_t c = 0; c < solids.size(); ++c) {
    const double part = static_cast<double>(share[c]) / options.cells;
    const base::Progress within = [&](double fraction) { base::Report(progress, done + part * fraction); };
    auto one = TessellateSolid(solids[c], static_cast<std::int32_t>(c), share[c], options, within, &cells);
    if (!one.ok()) return base::Annotate(one.status(), fmt::format("solid {} of {}", c, solids.size()));
    done += part;
    total.iterations = std::max(total.iterations, one->iterations);
    total.evaluations += one->evaluations;
    total.energy_start += one->energy_start;
    total.energy += one->energy;
    gradient_squared += one->gradient_norm * one->gradient_norm;
    if (c == 0) total.why_stopped = one->why_stopped;  // of the largest
  }
  cells.energy = total.energy;
  cells.iterations = total.iterations;
  cells.surface_area = geometry::SurfaceArea(shape.surface);
  if (summary) {
    const double volume = std::accumulate(shape.component_volume.begin(), shape.component_volume.end(), 0.0);
    total.gradient_norm = std::sqrt(gradient_squared);
    total.second_moment = geometry::NormalisedSecondMoment(cells);
    total.volume_error = std::abs(std::accumulate(cells.volume.begin(), cells.volume.end(), 0.0) - volume) / volume;
    *summary = total;
  }
  return cells;
}

absl::StatusOr<ClippedMoments> EvaluateClippedCells(const Shape& shape, const std::vector<Vec3>& sites, Neighbours neighbours) {
  RETURN_IF_ERROR(CheckShape(shape));
  for (std::size_t i = 0; i < sites.size(); ++i) {
    if (!sites[i].allFinite()) return absl::InvalidArgumentError(fmt::format("site {} is not finite", i));
  }
  const std::vector<Solid> solids = SolidsOf(shape);
  const std::vector<std::int32_t> solid_of = SolidOfSites(solids, sites);
  ClippedMoments result;
  result.volume.resize(sites.size());
  result.centroid.resize(sites.size());
  result.second_moment.resize(sites.size());
  result.gradient.resize(sites.size());
  for (std::size_t c = 0; c < solids.size(); ++c) {
    std::vector<std::size_t> members;
    std::vector<Vec3> own;
    for (std::size_t i = 0; i < sites.size(); ++i) {
      if (solid_of[i] != static_cast<std::int32_t>(c)) continue;
      members.push_back(i);
      own.push_back(sites[i]);
    }
    if (own.empty()) return absl::InvalidArgumentError(fmt::format("none of the {} sites lies in or next to solid {}", sites.size(), c));
    ClippedCells clipped(solids[c], neighbours);
    RETURN_IF_ERROR(clipped.Evaluate(own, nullptr));
    for (std::size_t k = 0; k < members.size(); ++k) {
      const Moments& m = clipped.moments()[k];
      const std::size_t i = members[k];
      result.volume[i] = m.volume;
      result.centroid[i] = m.volume > 0 ? Vec3(sites[i] + m.first / m.volume) : sites[i];
      result.second_moment[i] = m.second;
      result.gradient[i] = -2 * m.first;
      result.energy += m.second;
    }
  }
  return result;
}

}  // namespace vorocast::cvt
