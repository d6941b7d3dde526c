// SPDX-License-Identifier: AGPL-3.0-or-later
#include "workers/cvt/surface_from_points.h"

#include <fmt/format.h>

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <ctime>

#include "workers/cvt/cgal_poisson.h"
#include "workers/cvt/local_isovalue.h"
#include "workers/cvt/marching_cubes.h"
#include "workers/cvt/point_areas.h"
#include "workers/cvt/point_distance.h"
#include "workers/cvt/shells.h"
#include "workers/cvt/sorted_points.h"
#include "workers/cvt/spectral_poisson.h"
#include "workers/cvt/surface_fit.h"

namespace vorocast::cvt {
namespace {

using geometry::Vec3;

constexpr std::size_t kFewestPoints = 100;
/// Shells below this many grid cells in volume are noise.
constexpr double kSmallestShellCells = 30;

double ThreadCpuSeconds() {
  timespec time{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &time);
  return static_cast<double>(time.tv_sec) + 1e-9 * static_cast<double>(time.tv_nsec);
}

absl::Status CheckPoints(const geometry::OrientedPoints& points) {
  if (points.normals.size() != points.size()) {
    return absl::InvalidArgumentError(fmt::format("indicator: {} points with {} normals; every point needs one (the frame reader estimates them)",
                                                  points.size(), points.normals.size()));
  }
  if (points.size() < kFewestPoints) {
    return absl::InvalidArgumentError(
        fmt::format("indicator: {} points cannot bound a volume; at least {} are needed", points.size(), kFewestPoints));
  }
  std::size_t not_finite = 0;
  std::size_t not_unit = 0;
  for (std::size_t p = 0; p < points.size(); ++p) {
    if (!points.positions[p].allFinite() || !points.normals[p].allFinite()) {
      ++not_finite;
    } else if (std::abs(points.normals[p].norm() - 1) > 0.01) {
      ++not_unit;
    }
  }
  if (not_finite > 0) {
    return absl::InvalidArgumentError(
        fmt::format("indicator: {} of {} points or normals are not finite; remove those points from the frame", not_finite, points.size()));
  }
  if (not_unit > 0) {
    return absl::InvalidArgumentError(
        fmt::format("indicator: {} of {} normals are not of unit length; normalise them and remove points without one", not_unit, points.size()));
  }
  return absl::OkStatus();
}

/// Refuses points on a plane, a line or at one place.
absl::Status CheckSolid(const geometry::OrientedPoints& points) {
  Vec3 mean = Vec3::Zero();
  for (const Vec3& x : points.positions) mean += x / static_cast<double>(points.size());
  geometry::Mat3 covariance = geometry::Mat3::Zero();
  for (const Vec3& x : points.positions) covariance += (x - mean) * (x - mean).transpose();
  const Vec3 spread = Eigen::SelfAdjointEigenSolver<geometry::Mat3>(covariance, Eigen::EigenvaluesOnly).eigenvalues().cwiseMax(0).cwiseSqrt();
  if (!(spread[0] > 1e-3 * spread[2])) {
    return absl::InvalidArgumentError(
        "indicator: the points lie on a plane, a line or one spot and bound no volume; give points from all around the shape");
  }
  return absl::OkStatus();
}

/// Refuses points whose normals mostly face one way: they lie on a sheet, not around a solid.
absl::Status CheckSurrounding(const SortedPoints& points) {
  geometry::Vec3f flux = geometry::Vec3f::Zero();
  float area = 0;
  for (const GridPoint& p : points.points()) {
    flux += p.area * p.normal;
    area += p.area;
  }
  // Σ area n is 0 for a closed surface, half the area for a hemisphere, all of it for a sheet seen from one side.
  if (flux.norm() > 0.6F * area) {
    return absl::InvalidArgumentError(
        fmt::format("indicator: the surface is open: {:.0f} % of it faces one way, so it encloses no volume; capture the shape from all around",
                    100 * flux.norm() / area));
  }
  return absl::OkStatus();
}

GridFrame ChooseGrid(const geometry::OrientedPoints& points, const IndicatorOptions& options, double mean_spacing) {
  geometry::Box3 box;
  for (const Vec3& x : points.positions) box.extend(x);
  const double extent = box.sizes().maxCoeff();
  const double spacing = options.spacing_m > 0 ? options.spacing_m : std::min(1.5 * mean_spacing, extent / 100);
  // The transform is periodic: copies of the shape must be far enough apart that what leaks out of holes does not join them.
  const double margin = std::max(6 * spacing, 0.04 * extent);
  return FitGrid(box, spacing, margin, options.grid_nodes_max);
}

/// Mean over the grid's six faces: well away from the shape, so outside.
double MeanOnBorder(const ScalarGrid& grid) {
  const auto& nodes = grid.frame.nodes;
  double sum = 0;
  std::int64_t count = 0;
  for (std::int32_t i = 0; i < nodes[0]; ++i) {
    for (std::int32_t j = 0; j < nodes[1]; ++j) {
      const bool on_side = i == 0 || j == 0 || i == nodes[0] - 1 || j == nodes[1] - 1;
      for (std::int32_t k = 0; k < nodes[2]; k += on_side ? 1 : nodes[2] - 1) {
        sum += grid.value[grid.frame.Index(i, j, k)];
        ++count;
      }
    }
  }
  return sum / static_cast<double>(count);
}

absl::StatusOr<ScalarGrid> ComputeIndicator(const GridFrame& frame, const geometry::OrientedPoints& points, const SortedPoints& sorted,
                                            const IndicatorOptions& options, double mean_spacing) {
  if (options.method == IndicatorMethod::kCgal) return SampleCgalPoisson(frame, points);
  // Smooth at least so far that the gaps between points do not show.
  const double smoothing = std::max(options.smoothing_cells, 0.8 * mean_spacing / frame.spacing);
  ScalarGrid indicator = SolveSpectralPoisson(frame, sorted, smoothing);
  SubtractLocalIsovalue(sorted, indicator);
  return indicator;
}

/// The shells that points lie on over a good part of their area and that are no mere specks.
std::vector<bool> SupportedShells(const Shells& shells, const SortedPoints& points, const PointSurfaceDistances& distances, double spacing) {
  constexpr float kSupportCells = 2;
  constexpr double kLeastSupport = 0.2;
  std::vector<double> supported(static_cast<std::size_t>(shells.count), 0);
  for (std::size_t p = 0; p < points.points().size(); ++p) {
    if (distances.distance[p] > kSupportCells) continue;
    const std::int32_t shell = shells.of_triangle[static_cast<std::size_t>(distances.triangle[p])];
    supported[static_cast<std::size_t>(shell)] += points.points()[p].area * spacing * spacing;
  }
  std::vector<bool> keep;
  for (std::size_t s = 0; s < supported.size(); ++s) {
    keep.push_back(supported[s] >= kLeastSupport * shells.area[s] && std::abs(shells.volume[s]) >= kSmallestShellCells * std::pow(spacing, 3));
  }
  return keep;
}

void Summarise(const Shells& shells, const std::vector<bool>& keep, const PointSurfaceDistances& distances, double spacing,
               IndicatorSummary& summary) {
  double sum = 0;
  for (std::size_t p = 0; p < distances.distance.size(); ++p) {
    const bool near = distances.triangle[p] >= 0;
    const bool dropped = near && !keep[static_cast<std::size_t>(shells.of_triangle[static_cast<std::size_t>(distances.triangle[p])])];
    const double cells = dropped ? kFarthestCells : distances.distance[p];
    sum += cells;
    if (dropped) ++summary.points_dropped_shells;
    if (!dropped && cells > 2) ++summary.points_far;
  }
  summary.distance_mean_m = spacing * sum / static_cast<double>(distances.distance.size());
}

}  // namespace

absl::StatusOr<ClosedSurface> SurfaceFromPoints(const geometry::OrientedPoints& points, const IndicatorOptions& options, IndicatorSummary* summary) {
  RETURN_IF_ERROR(options.Validate());
  RETURN_IF_ERROR(CheckPoints(points));
  RETURN_IF_ERROR(CheckSolid(points));
  const double mean_spacing = MeanPointSpacing(points);
  const GridFrame frame = ChooseGrid(points, options, mean_spacing);
  const float mean_spacing_cells = static_cast<float>(mean_spacing / frame.spacing);
  const SurfaceFitOptions fit;
  SortedPoints sorted(points, frame, fit.radius);
  EstimateAreas(frame, mean_spacing_cells, sorted);
  RETURN_IF_ERROR(CheckSurrounding(sorted));

  const double start = ThreadCpuSeconds();
  ASSIGN_OR_RETURN(const ScalarGrid indicator, ComputeIndicator(frame, points, sorted, options, mean_spacing));
  const double seconds_solve = ThreadCpuSeconds() - start;
  if (MeanOnBorder(indicator) >= 0) {
    return absl::InvalidArgumentError("indicator: the solid came out outside the surface: the normals point inward; turn them round");
  }

  GridSurface surface = MarchingCubes(indicator);
  FitSurface(sorted, frame, fit, surface.mesh);
  const PointSurfaceDistances distances = DistancesToSurface(sorted, frame, surface);
  const Shells shells = FindShells(surface.mesh);
  const std::vector<bool> keep = SupportedShells(shells, sorted, distances, frame.spacing);
  ClosedSurface closed{KeepShells(surface.mesh, shells, keep), frame.spacing};
  if (!(geometry::SignedVolume(closed.mesh) > 0)) {
    return absl::InvalidArgumentError(
        fmt::format("indicator: the {} points enclose no volume at a spacing of {:.4f} m; check that their normals point outward and that they "
                    "surround the shape, or give a smaller spacing_m",
                    points.size(), frame.spacing));
  }
  if (summary != nullptr) {
    *summary = {};
    summary->spacing_m = frame.spacing;
    summary->seconds_solve = seconds_solve;
    Summarise(shells, keep, distances, frame.spacing, *summary);
  }
  return closed;
}

}  // namespace vorocast::cvt
