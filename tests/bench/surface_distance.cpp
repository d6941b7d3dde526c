// SPDX-License-Identifier: AGPL-3.0-or-later
#include "tests/bench/surface_distance.h"

#include <CGAL/AABB_traits.h>
#include <CGAL/AABB_tree.h>
#include <CGAL/AABB_triangle_primitive.h>
#include <CGAL/Simple_cartesian.h>

#include <algorithm>
#include <cmath>
#include <numeric>

namespace vorocast::bench {
namespace {

using Kernel = CGAL::Simple_cartesian<double>;
using Triangles = std::vector<Kernel::Triangle_3>;
using Primitive = CGAL::AABB_triangle_primitive<Kernel, Triangles::const_iterator>;
using Tree = CGAL::AABB_tree<CGAL::AABB_traits<Kernel, Primitive>>;

Kernel::Point_3 Point(const geometry::Vec3& x) { return {x.x(), x.y(), x.z()}; }

}  // namespace

SurfaceDistances DistancesTo(const geometry::TriangleMesh& surface, const std::vector<geometry::Vec3>& points) {
  Triangles triangles;
  for (const auto& [a, b, c] : surface.triangles) {
    const Kernel::Triangle_3 triangle(Point(surface.vertices[static_cast<std::size_t>(a)]), Point(surface.vertices[static_cast<std::size_t>(b)]),
                                      Point(surface.vertices[static_cast<std::size_t>(c)]));
    if (!triangle.is_degenerate()) triangles.push_back(triangle);
  }
  if (triangles.empty() || points.empty()) return {};
  Tree tree(triangles.begin(), triangles.end());
  tree.accelerate_distance_queries();
  std::vector<double> distances;
  for (const geometry::Vec3& x : points) distances.push_back(std::sqrt(tree.squared_distance(Point(x))));
  std::ranges::sort(distances);
  const double sum = std::accumulate(distances.begin(), distances.end(), 0.0);
  return {sum, sum / static_cast<double>(distances.size()), distances[distances.size() * 95 / 100], distances.back()};
}

}  // namespace vorocast::bench
