// SPDX-License-Identifier: AGPL-3.0-or-later
#include "services/capture/estimate_normals.h"

#include <CGAL/Orthogonal_k_neighbor_search.h>
#include <CGAL/Search_traits_3.h>
#include <CGAL/Search_traits_adapter.h>
#include <CGAL/Simple_cartesian.h>
#include <CGAL/mst_orient_normals.h>
#include <CGAL/pca_estimate_normals.h>
#include <CGAL/property_map.h>
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <exception>
#include <numeric>
#include <tuple>

namespace vorocast::capture {
namespace {

using geometry::Vec3;
using Kernel = CGAL::Simple_cartesian<double>;

/// Position, normal, index in the input: CGAL puts its points into another order.
using Point = std::tuple<Kernel::Point_3, Kernel::Vector_3, std::size_t>;
using PositionMap = CGAL::Nth_of_tuple_property_map<0, Point>;
using NormalMap = CGAL::Nth_of_tuple_property_map<1, Point>;

constexpr std::size_t kPointsMin = 16;
/// Neighbours of the plane fit and of the spanning tree: CGAL's advice for noisy scans.
constexpr unsigned int kFitNeighbours = 18;
constexpr unsigned int kTreeNeighbours = 12;
/// Neighbours that connect two points into one part.
constexpr unsigned int kPartNeighbours = 8;

auto Parameters() { return CGAL::parameters::point_map(PositionMap()).normal_map(NormalMap()).geom_traits(Kernel()); }

std::size_t Find(std::vector<std::size_t>& parent, std::size_t i) {
  while (parent[i] != i) i = parent[i] = parent[parent[i]];
  return i;
}

/// Parts of the cloud that no neighbour relation joins, each in the order of the input: a dancer and a cage get their signs apart.
std::vector<std::vector<Point>> SplitParts(const std::vector<Point>& points) {
  using Traits = CGAL::Search_traits_adapter<Point, PositionMap, CGAL::Search_traits_3<Kernel>>;
  using Search = CGAL::Orthogonal_k_neighbor_search<Traits>;
  const typename Search::Tree tree(points.begin(), points.end());
  std::vector<std::size_t> parent(points.size());
  std::iota(parent.begin(), parent.end(), std::size_t{0});
  for (std::size_t i = 0; i < points.size(); ++i) {
    Search search(tree, std::get<0>(points[i]), kPartNeighbours + 1);
    for (const auto& [neighbour, squared_distance] : search) {
      const std::size_t a = Find(parent, i);
      const std::size_t b = Find(parent, std::get<2>(neighbour));
      parent[std::max(a, b)] = std::min(a, b);
    }
  }
  std::vector<std::vector<Point>> parts;
  std::vector<std::size_t> part_of(points.size());
  for (std::size_t i = 0; i < points.size(); ++i) {
    const std::size_t root = Find(parent, i);
    if (root == i) {
      part_of[i] = parts.size();
      parts.emplace_back();
    }
    parts[part_of[root]].push_back(points[i]);
  }
  return parts;
}

/// Signs that agree between neighbours, then the sign of the whole part.
void Orient(std::vector<Point>& part, std::vector<Vec3>& normals) {
  const auto neighbours = static_cast<unsigned int>(std::min<std::size_t>(kTreeNeighbours, part.size() - 1));
  if (neighbours > 1) CGAL::mst_orient_normals(part, neighbours, Parameters());
  std::vector<Vec3> part_positions;
  std::vector<Vec3> part_normals;
  for (const auto& [position, normal, index] : part) {
    part_positions.emplace_back(position.x(), position.y(), position.z());
    part_normals.emplace_back(normal.x(), normal.y(), normal.z());
  }
  const double sign = Outwardness(part_positions, part_normals) < 0 ? -1 : 1;
  for (std::size_t i = 0; i < part.size(); ++i) {
    const double length = part_normals[i].norm();
    normals[std::get<2>(part[i])] = length > 0 && std::isfinite(length) ? Vec3(sign / length * part_normals[i]) : Vec3(Vec3::Zero());
  }
}

}  // namespace

absl::StatusOr<std::vector<Vec3>> EstimateNormals(const std::vector<Vec3>& positions) try {
  if (positions.size() < kPointsMin) {
    return absl::InvalidArgumentError(fmt::format("{} points are too few to estimate normals: give {} or more", positions.size(), kPointsMin));
  }
  std::vector<Point> points;
  points.reserve(positions.size());
  for (std::size_t i = 0; i < positions.size(); ++i) {
    points.emplace_back(Kernel::Point_3(positions[i].x(), positions[i].y(), positions[i].z()), Kernel::Vector_3(0, 0, 0), i);
  }
  const auto neighbours = static_cast<unsigned int>(std::min<std::size_t>(kFitNeighbours, points.size() - 1));
  CGAL::pca_estimate_normals<CGAL::Sequential_tag>(points, neighbours, Parameters());
  std::vector<Vec3> normals(positions.size(), Vec3::Zero());
  for (std::vector<Point>& part : SplitParts(points)) Orient(part, normals);
  return normals;
} catch (const std::exception& error) {
  return absl::InvalidArgumentError(fmt::format("normals cannot be estimated from these points ({}): give a file with normals", error.what()));
}

double Outwardness(const std::vector<Vec3>& positions, const std::vector<Vec3>& normals) {
  if (positions.empty()) return 0;
  Vec3 centroid = Vec3::Zero();
  for (const Vec3& p : positions) centroid += p;
  centroid /= static_cast<double>(positions.size());
  double flux = 0;
  double absolute = 0;
  for (std::size_t i = 0; i < positions.size(); ++i) {
    const Vec3 arm = positions[i] - centroid;
    flux += arm.dot(normals[i]);
    absolute += arm.norm() * normals[i].norm();
  }
  return absolute > 0 ? flux / absolute : 0;
}

}  // namespace vorocast::capture
