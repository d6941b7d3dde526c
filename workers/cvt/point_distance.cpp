// SPDX-License-Identifier: AGPL-3.0-or-later
#include "workers/cvt/point_distance.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

namespace vorocast::cvt {
namespace {

using geometry::Vec3f;

/// By the region of the triangle's plane the point lies over: a corner, an edge or the inside (Ericson, Real-Time Collision Detection, 5.1.5).
float SquaredDistanceToTriangle(const Vec3f& p, const Vec3f& a, const Vec3f& b, const Vec3f& c) {
  const Vec3f ab = b - a;
  const Vec3f ac = c - a;
  const Vec3f ap = p - a;
  const float ab_ap = ab.dot(ap);
  const float ac_ap = ac.dot(ap);
  if (ab_ap <= 0 && ac_ap <= 0) return ap.squaredNorm();
  const Vec3f bp = p - b;
  const float ab_bp = ab.dot(bp);
  const float ac_bp = ac.dot(bp);
  if (ab_bp >= 0 && ac_bp <= ab_bp) return bp.squaredNorm();
  const float over_ab = ab_ap * ac_bp - ab_bp * ac_ap;
  if (over_ab <= 0 && ab_ap >= 0 && ab_bp <= 0) return (ap - ab * (ab_ap / (ab_ap - ab_bp))).squaredNorm();
  const Vec3f cp = p - c;
  const float ab_cp = ab.dot(cp);
  const float ac_cp = ac.dot(cp);
  if (ac_cp >= 0 && ab_cp <= ac_cp) return cp.squaredNorm();
  const float over_ac = ab_cp * ac_ap - ab_ap * ac_cp;
  if (over_ac <= 0 && ac_ap >= 0 && ac_cp <= 0) return (ap - ac * (ac_ap / (ac_ap - ac_cp))).squaredNorm();
  const float over_bc = ab_bp * ac_cp - ab_cp * ac_bp;
  const float to_c = ac_bp - ab_bp;
  const float to_b = ab_cp - ac_cp;
  if (over_bc <= 0 && to_c >= 0 && to_b >= 0) return (bp - (c - b) * (to_c / (to_c + to_b))).squaredNorm();
  const float whole = over_ab + over_ac + over_bc;
  return (ap - ab * (over_ac / whole) - ac * (over_ab / whole)).squaredNorm();
}

/// The triangles of a surface by the grid cell they were cut from, corners in grid units.
class TriangleGrid {
 public:
  TriangleGrid(const GridFrame& frame, const GridSurface& surface) : frame_(frame), surface_(surface), first_(frame.size() + 1, 0) {
    for (std::int64_t cell : surface.triangle_cell) ++first_[static_cast<std::size_t>(cell) + 1];
    for (std::size_t c = 1; c < first_.size(); ++c) first_[c] += first_[c - 1];
    corners_.reserve(surface.mesh.vertices.size());
    for (const geometry::Vec3& x : surface.mesh.vertices) corners_.push_back(frame.ToGrid(x));
    spheres_.reserve(surface.mesh.triangles.size());
    for (const auto& t : surface.mesh.triangles) {
      const auto at = [&](std::size_t v) -> const Vec3f& { return corners_[static_cast<std::size_t>(t[v])]; };
      const Vec3f centre = (at(0) + at(1) + at(2)) / 3;
      const float squared = std::max({(at(0) - centre).squaredNorm(), (at(1) - centre).squaredNorm(), (at(2) - centre).squaredNorm()});
      spheres_.push_back({centre, std::sqrt(squared)});
    }
  }

  struct Nearest {
    float distance = std::numeric_limits<float>::infinity();
    std::int32_t triangle = -1;
  };

  void VisitTriangle(const Vec3f& p, std::int32_t triangle, Nearest& nearest) const {
    // Most candidates are too far away for their exact distance to matter.
    const Sphere& around = spheres_[static_cast<std::size_t>(triangle)];
    const float bound = nearest.distance + around.radius;
    if ((p - around.centre).squaredNorm() >= bound * bound) return;
    const auto& corner = surface_.mesh.triangles[static_cast<std::size_t>(triangle)];
    const auto at = [&](std::size_t v) -> const Vec3f& { return corners_[static_cast<std::size_t>(corner[v])]; };
    const float distance = std::sqrt(SquaredDistanceToTriangle(p, at(0), at(1), at(2)));
    if (distance < nearest.distance) nearest = {distance, triangle};
  }

  /// The triangles of the cells that the ball around p touches, which shrinks to the distance found (and kSlack) on the way.
  void VisitBall(const Vec3f& p, float radius, Nearest& nearest) const {
    const std::int32_t first_i = Cell(0, p[0] - radius);
    const std::int32_t last_i = Cell(0, p[0] + radius);
    const std::int32_t first_j = Cell(1, p[1] - radius);
    const std::int32_t last_j = Cell(1, p[1] + radius);
    for (std::int32_t i = first_i; i <= last_i; ++i) {
      for (std::int32_t j = first_j; j <= last_j; ++j) {
        const float reach = std::min(radius, nearest.distance + kSlack);
        const float aside = Outside(i, p[0]) * Outside(i, p[0]) + Outside(j, p[1]) * Outside(j, p[1]);
        if (aside > reach * reach) continue;
        const float half = std::sqrt(reach * reach - aside);
        // Cells along the last axis follow one another, and so do their triangles.
        const std::int32_t end = first_[frame_.Index(i, j, Cell(2, p[2] + half)) + 1];
        for (std::int32_t t = first_[frame_.Index(i, j, Cell(2, p[2] - half))]; t < end; ++t) VisitTriangle(p, t, nearest);
      }
    }
  }

  /// How far a triangle may reach out of the cell it was cut from.
  static constexpr float kSlack = 0.75F;

 private:
  struct Sphere {
    Vec3f centre;
    float radius;
  };

  std::int32_t Cell(std::size_t axis, float x) const { return std::clamp(static_cast<std::int32_t>(std::floor(x)), 0, frame_.nodes[axis] - 1); }
  /// Distance of a coordinate from the cell [i, i + 1].
  static float Outside(std::int32_t i, float x) { return std::max({0.0F, static_cast<float>(i) - x, x - static_cast<float>(i + 1)}); }

  const GridFrame& frame_;
  const GridSurface& surface_;
  std::vector<std::int32_t> first_;
  std::vector<Vec3f> corners_;
  std::vector<Sphere> spheres_;  // around each triangle
};

/// `guess` is a triangle that is likely to be near, or −1. Most points lie so near the surface that half a cell around them settles it.
TriangleGrid::Nearest FindNearest(const TriangleGrid& grid, const Vec3f& p, std::int32_t guess) {
  TriangleGrid::Nearest nearest;
  if (guess >= 0) grid.VisitTriangle(p, guess, nearest);
  grid.VisitBall(p, 0.5F, nearest);
  if (nearest.distance <= 0.5F) return nearest;
  grid.VisitBall(p, 1.5F, nearest);
  if (nearest.distance + TriangleGrid::kSlack > 1.5F) grid.VisitBall(p, kFarthestCells + TriangleGrid::kSlack, nearest);
  return nearest;
}

}  // namespace

PointSurfaceDistances DistancesToSurface(const SortedPoints& points, const GridFrame& frame, const GridSurface& surface) {
  const TriangleGrid grid(frame, surface);
  PointSurfaceDistances found;
  found.distance.reserve(points.points().size());
  found.triangle.reserve(points.points().size());
  std::int32_t last_triangle = -1;
  for (const GridPoint& p : points.points()) {
    const TriangleGrid::Nearest nearest = FindNearest(grid, p.u, last_triangle);
    last_triangle = nearest.triangle;
    const bool near = nearest.distance <= kFarthestCells;
    found.distance.push_back(near ? nearest.distance : kFarthestCells);
    found.triangle.push_back(near ? nearest.triangle : -1);
  }
  return found;
}

}  // namespace vorocast::cvt
