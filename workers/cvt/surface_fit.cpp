// SPDX-License-Identifier: AGPL-3.0-or-later
#include "workers/cvt/surface_fit.h"

#include <algorithm>

namespace vorocast::cvt {
namespace {

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

}  // namespace

void FitSurface(const SortedPoints& points, const GridFrame& frame, const SurfaceFitOptions& options, geometry::TriangleMesh& mesh) {
  const std::vector<geometry::Vec3> facing = geometry::VertexNormals(mesh);
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
}

}  // namespace vorocast::cvt
