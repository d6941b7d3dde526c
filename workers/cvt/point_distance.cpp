// SPDX-License-Identifier: AGPL-3.0-or-later
#include "workers/cvt/point_distance.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

namespace vorocast::cvt {
namespace {

using geometry::Vec3f;

float SquaredDistanceToSegment(const Vec3f& p, const Vec3f& a, const Vec3f& ab) {
  const float length = ab.squaredNorm();
  const float t = length > 0 ? std::clamp((p - a).dot(ab) / length, 0.0F, 1.0F) : 0.0F;
  return (p - a - t * ab).squaredNorm();
}

float SquaredDistanceToTriangle(const Vec3f& p, const Vec3f& a, const Vec3f& b, const Vec3f& c) {
  const Vec3f ab = b - a;
  const Vec3f bc = c - b;
  const Vec3f ca = a - c;
  const Vec3f n = ab.cross(-ca);
  const float area = n.squaredNorm();
  if (area > 0 && n.dot(ab.cross(p - a)) >= 0 && n.dot(bc.cross(p - b)) >= 0 && n.dot(ca.cross(p - c)) >= 0) {
    const float height = n.dot(p - a);
    return height * height / area;
  }
  return std::min({SquaredDistanceToSegment(p, a, ab), SquaredDistanceToSegment(p, b, bc), SquaredDistanceToSegment(p, c, ca)});
}

/// The triangles of a surface by the grid cell they were cut from, corners in grid units.
class TriangleGrid {
 public:
  TriangleGrid(const GridFrame& frame, const GridSurface& surface) : frame_(frame), surface_(surface), first_(frame.size() + 1, 0) {
    for (std::int64_t cell : surface.triangle_cell) ++first_[static_cast<std::size_t>(cell) + 1];
    for (std::size_t c = 1; c < first_.size(); ++c) first_[c] += first_[c - 1];
    corners_.reserve(surface.mesh.vertices.size());
    for (const geometry::Vec3& x : surface.mesh.vertices) corners_.push_back(frame.ToGrid(x));
  }

  struct Nearest {
    float squared = std::numeric_limits<float>::infinity();
    std::int32_t triangle = -1;
  };

  void Visit(const Vec3f& p, const std::array<std::int32_t, 3>& low, const std::array<std::int32_t, 3>& high, Nearest& nearest) const {
    std::array<std::int32_t, 3> from;
    std::array<std::int32_t, 3> to;
    for (std::size_t a = 0; a < 3; ++a) {
      from[a] = std::clamp(low[a], 0, frame_.nodes[a] - 1);
      to[a] = std::clamp(high[a], 0, frame_.nodes[a] - 1);
    }
    for (std::int32_t i = from[0]; i <= to[0]; ++i) {
      for (std::int32_t j = from[1]; j <= to[1]; ++j) {
        // Cells along the last axis follow one another, and so do their triangles.
        const std::int32_t end = first_[frame_.Index(i, j, to[2]) + 1];
        for (std::int32_t t = first_[frame_.Index(i, j, from[2])]; t < end; ++t) {
          const auto& corner = surface_.mesh.triangles[static_cast<std::size_t>(t)];
          const auto at = [&](std::size_t v) -> const Vec3f& { return corners_[static_cast<std::size_t>(corner[v])]; };
          const float squared = SquaredDistanceToTriangle(p, at(0), at(1), at(2));
          if (squared < nearest.squared) nearest = {squared, t};
        }
      }
    }
  }

 private:
  const GridFrame& frame_;
  const GridSurface& surface_;
  std::vector<std::int32_t> first_;
  std::vector<Vec3f> corners_;
};

/// First the eight cells whose common corner is nearest to the point, then rings of cells until what was found cannot be beaten.
TriangleGrid::Nearest FindNearest(const TriangleGrid& grid, const Vec3f& p) {
  TriangleGrid::Nearest nearest;
  std::array<std::int32_t, 3> cell;
  std::array<std::int32_t, 3> corner;
  for (int a = 0; a < 3; ++a) {
    cell[static_cast<std::size_t>(a)] = static_cast<std::int32_t>(std::floor(p[a]));
    corner[static_cast<std::size_t>(a)] = static_cast<std::int32_t>(std::round(p[a]));
  }
  grid.Visit(p, {corner[0] - 1, corner[1] - 1, corner[2] - 1}, corner, nearest);
  if (nearest.squared <= 0.25F) return nearest;
  for (std::int32_t ring = 1; ring <= static_cast<std::int32_t>(kFarthestCells); ++ring) {
    grid.Visit(p, {cell[0] - ring, cell[1] - ring, cell[2] - ring}, {cell[0] + ring, cell[1] + ring, cell[2] + ring}, nearest);
    if (nearest.squared <= static_cast<float>(ring * ring)) break;
  }
  return nearest;
}

}  // namespace

PointSurfaceDistances DistancesToSurface(const SortedPoints& points, const GridFrame& frame, const GridSurface& surface) {
  const TriangleGrid grid(frame, surface);
  PointSurfaceDistances found;
  found.distance.reserve(points.points().size());
  found.triangle.reserve(points.points().size());
  for (const GridPoint& p : points.points()) {
    const TriangleGrid::Nearest nearest = FindNearest(grid, p.u);
    const bool near = nearest.squared <= kFarthestCells * kFarthestCells;
    found.distance.push_back(near ? std::sqrt(nearest.squared) : kFarthestCells);
    found.triangle.push_back(near ? nearest.triangle : -1);
  }
  return found;
}

}  // namespace vorocast::cvt
