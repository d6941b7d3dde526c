// SPDX-License-Identifier: AGPL-3.0-or-later
#include "workers/cvt/surface_fit.h"

#include <algorithm>
#include <array>
#include <vector>

namespace vorocast::cvt {
namespace {

using geometry::Vec3;
using geometry::Vec3f;

/// Weighted sums over the points near a position, relative to it.
struct Neighbourhood {
  float weight = 0;
  int count = 0;
  Vec3f offset = Vec3f::Zero();  // Σ w (p − x)
  Vec3f normal = Vec3f::Zero();  // Σ w n
  float hermite = 0;             // Σ w n·(x − p)
};

Neighbourhood Gather(const SortedPoints& points, const Vec3f& x, const Vec3f& facing, float radius) {
  Neighbourhood sums;
  const float scale = 1 / (radius * radius);
  points.ForEachNear(x, radius, [&](const GridPoint& p) {
    const Vec3f offset = p.u - x;
    const float closeness = 1 - offset.squaredNorm() * scale;
    if (closeness <= 0) return;
    // Points of the other side of a thin part face away and must not pull.
    const float agreement = p.normal.dot(facing) - 0.2F;
    if (agreement <= 0) return;
    const float w = closeness * closeness * agreement * p.area;
    sums.weight += w;
    ++sums.count;
    sums.offset += w * offset;
    sums.normal += w * p.normal;
    sums.hermite -= w * p.normal.dot(offset);
  });
  return sums;
}

/// Signed distance from the fitted surface, along `normal`. The mean plane through the points lies inside a convex surface by as much as
/// the mean of the points' own tangent planes lies outside it, so that half of each is exact to second order.
float FittedHeight(const Neighbourhood& sums, const Vec3f& normal) { return 0.5F * (sums.hermite - normal.dot(sums.offset)) / sums.weight; }

/// How far the points around carry a vertex: 0 with next to none or all on one side, towards 1 with a full disc of them.
float Support(const Neighbourhood& sums, const Vec3f& normal, float radius) {
  if (sums.count < 3) return 0;
  // A full disc has Σ area (1 − r²)² = π R² / 3; points at the rim of a hole cover half of one.
  const float full = 0.33F * 3.14F * radius * radius / 3;
  const float coverage = sums.weight / (sums.weight + 0.15F * full);
  const Vec3f mean = sums.offset / sums.weight;
  const float aside = (mean - mean.dot(normal) * normal).norm() / radius;
  return coverage * std::clamp(1.5F - 2.5F * aside, 0.0F, 1.0F);
}

Vec3 AreaVector(const std::vector<Vec3>& vertices, const std::array<std::int32_t, 3>& t) {
  const Vec3& a = vertices[static_cast<std::size_t>(t[0])];
  return (vertices[static_cast<std::size_t>(t[1])] - a).cross(vertices[static_cast<std::size_t>(t[2])] - a);
}

/// Puts the corners of triangles that the fit turned over, or nearly, back to where they were: there the points contradict one another,
/// and the surface would cross itself.
void UndoFolds(const std::vector<Vec3>& before, geometry::TriangleMesh& mesh) {
  constexpr double kLeastCosine = 0.3;
  constexpr int kMostPasses = 4;
  for (int pass = 0; pass < kMostPasses; ++pass) {
    std::vector<std::int32_t> folded;
    for (const auto& t : mesh.triangles) {
      const Vec3 old_area = AreaVector(before, t);
      const Vec3 new_area = AreaVector(mesh.vertices, t);
      if (old_area.dot(new_area) < kLeastCosine * old_area.norm() * new_area.norm()) folded.insert(folded.end(), t.begin(), t.end());
    }
    if (folded.empty()) return;
    for (std::int32_t v : folded) mesh.vertices[static_cast<std::size_t>(v)] = before[static_cast<std::size_t>(v)];
  }
}

}  // namespace

void FitSurface(const SortedPoints& points, const GridFrame& frame, const SurfaceFitOptions& options, geometry::TriangleMesh& mesh) {
  const std::vector<Vec3> facing = geometry::VertexNormals(mesh);
  const std::vector<Vec3> before = mesh.vertices;
  for (std::size_t v = 0; v < mesh.vertices.size(); ++v) {
    const Vec3f start = frame.ToGrid(mesh.vertices[v]);
    Vec3f direction = facing[v].cast<float>();
    if (direction.squaredNorm() < 0.5F) continue;
    Vec3f x = start;
    for (int round = 0; round < options.rounds; ++round) {
      const Neighbourhood sums = Gather(points, x, direction, options.radius);
      const float length = sums.normal.norm();
      if (!(length > 0)) break;
      const Vec3f normal = sums.normal / length;
      x -= Support(sums, normal, options.radius) * FittedHeight(sums, normal) * normal;
      direction = normal;
    }
    const Vec3f step = x - start;
    const float length = step.norm();
    x = length > options.step_max ? Vec3f(start + step * (options.step_max / length)) : x;
    mesh.vertices[v] = frame.ToWorld(x);
  }
  UndoFolds(before, mesh);
}

}  // namespace vorocast::cvt
