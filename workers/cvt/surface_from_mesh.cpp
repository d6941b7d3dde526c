// SPDX-License-Identifier: AGPL-3.0-or-later
#include "workers/cvt/surface_from_mesh.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <exception>

#include "workers/cvt/point_distance.h"
#include "workers/cvt/self_intersection.h"
#include "workers/cvt/winding_grid.h"

namespace vorocast::cvt {
namespace {

using geometry::Vec3;

constexpr std::size_t kSampledPoints = 100'000;
constexpr std::uint64_t kSamplingSeed = 1;
/// A finer mesh is cut anew all the same: its detail is below what the cells can show and would only slow the clipping.
constexpr std::size_t kMostOwnTriangles = 250'000;

absl::Status CheckMesh(const geometry::TriangleMesh& mesh) {
  if (mesh.triangles.empty())
    return absl::InvalidArgumentError("indicator: the mesh has no triangles; give a mesh of a solid, or points with normals");
  const auto count = static_cast<std::int32_t>(mesh.vertices.size());
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    for (std::int32_t v : mesh.triangles[t]) {
      if (v < 0 || v >= count) {
        return absl::InvalidArgumentError(
            fmt::format("indicator: triangle {} has vertex {}, but there are {} vertices; repair the file", t, v, count));
      }
    }
  }
  const auto bad = std::ranges::count_if(mesh.vertices, [](const Vec3& x) { return !x.allFinite(); });
  if (bad > 0) return absl::InvalidArgumentError(fmt::format("indicator: {} of {} vertices are not finite; repair the file", bad, count));
  return absl::OkStatus();
}

/// Edge of the grid cells: as fine as 65 thousand points on the same surface would have it.
double ChooseSpacing(const geometry::TriangleMesh& mesh, const IndicatorOptions& options) {
  return options.spacing_m > 0 ? options.spacing_m : std::sqrt(geometry::SurfaceArea(mesh)) / 170;
}

GridFrame ChooseGrid(const geometry::TriangleMesh& mesh, const IndicatorOptions& options) {
  geometry::Box3 box;
  for (const Vec3& x : mesh.vertices) box.extend(x);
  const double spacing = std::min(ChooseSpacing(mesh, options), options.spacing_m > 0 ? options.spacing_m : box.sizes().maxCoeff() / 100);
  return FitGrid(box, spacing, 2 * spacing, options.grid_nodes_max);
}

double MeanVertexDistance(const geometry::TriangleMesh& mesh, const GridFrame& frame, const GridSurface& surface) {
  geometry::OrientedPoints vertices;
  vertices.positions = mesh.vertices;
  vertices.normals = geometry::VertexNormals(mesh);
  const PointSurfaceDistances found = DistancesToSurface(SortedPoints(vertices, frame, 2), frame, surface);
  double sum = 0;
  for (float d : found.distance) sum += d;
  return frame.spacing * sum / static_cast<double>(found.distance.size());
}

absl::StatusOr<ClosedSurface> CutAnew(const geometry::TriangleMesh& mesh, const IndicatorOptions& options, IndicatorSummary* summary) {
  const GridFrame frame = ChooseGrid(mesh, options);
  GridSurface surface = CutWindingNumber(mesh, frame);
  if (surface.mesh.triangles.empty()) {
    return absl::InvalidArgumentError(
        fmt::format("indicator: the mesh encloses no volume at a spacing of {:.4f} m; its triangles may be turned inside out, or it is too thin: "
                    "give a smaller spacing_m",
                    frame.spacing));
  }
  if (summary != nullptr) *summary = {.spacing_m = frame.spacing, .distance_mean_m = MeanVertexDistance(mesh, frame, surface)};
  return ClosedSurface{std::move(surface.mesh), frame.spacing};
}

}  // namespace

absl::StatusOr<ClosedSurface> SurfaceFromMesh(const geometry::TriangleMesh& mesh, const IndicatorOptions& options, IndicatorSummary* summary) {
  RETURN_IF_ERROR(options.Validate());
  RETURN_IF_ERROR(CheckMesh(mesh));
  if (!IsWithoutBorder(mesh)) {
    return SurfaceFromPoints(geometry::SampleSurface(mesh, kSampledPoints, kSamplingSeed), options, summary);
  }
  if (!(geometry::SignedVolume(mesh) > 0)) {
    return absl::InvalidArgumentError(
        fmt::format("indicator: the mesh encloses {:.3g} m³; turn its triangles round so that they face outward", geometry::SignedVolume(mesh)));
  }
  if (mesh.triangles.size() <= kMostOwnTriangles && geometry::IsClosed(mesh) && !CrossesItself(mesh)) {
    const double spacing = ChooseSpacing(mesh, options);
    if (summary != nullptr) *summary = {.spacing_m = spacing};
    return ClosedSurface{mesh, spacing};
  }
  return CutAnew(mesh, options, summary);
}

}  // namespace vorocast::cvt
