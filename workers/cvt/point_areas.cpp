// SPDX-License-Identifier: AGPL-3.0-or-later
#include "workers/cvt/point_areas.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace vorocast::cvt {
namespace {

using geometry::Vec3;
using geometry::Vec3f;

/// Number of cubes of edge `voxel` that hold a point.
std::size_t CountOccupied(const geometry::OrientedPoints& points, const Vec3& low, double voxel) {
  std::vector<std::uint64_t> keys;
  keys.reserve(points.size());
  for (const Vec3& x : points.positions) {
    const Eigen::Matrix<std::uint64_t, 3, 1> v = ((x - low) / voxel).cast<std::uint64_t>();
    keys.push_back((v[0] << 40) | (v[1] << 20) | v[2]);
  }
  std::ranges::sort(keys);
  return static_cast<std::size_t>(std::unique(keys.begin(), keys.end()) - keys.begin());
}

/// The three weights of the quadratic B-spline around a position, and the first node they belong to.
struct QuadraticSpline {
  std::int32_t first;
  std::array<float, 3> weight;

  explicit QuadraticSpline(float x) {
    const float nearest = std::round(x);
    const float t = x - nearest;
    first = static_cast<std::int32_t>(nearest) - 1;
    weight = {0.5F * (0.5F - t) * (0.5F - t), 0.75F - t * t, 0.5F * (0.5F + t) * (0.5F + t)};
  }
};

/// A coarse grid that holds, at each node, how many points there are around it and the sum of their normals.
class DensityGrid {
 public:
  DensityGrid(const GridFrame& frame, float cell) : cell_(cell) {
    for (std::size_t axis = 0; axis < 3; ++axis) nodes_[axis] = static_cast<std::size_t>(static_cast<float>(frame.nodes[axis]) / cell) + 4;
    node_.assign(nodes_[0] * nodes_[1] * nodes_[2], Eigen::Array4f::Zero());
  }

  void Add(const GridPoint& point) {
    const Eigen::Array4f one(1, point.normal[0], point.normal[1], point.normal[2]);
    ForEachNode(point.u, [&](std::size_t node, float weight) { node_[node] += weight * one; });
  }

  /// Points around this one, each counted by how far it faces the same way: (1 + n·n') / 2. Opposite sides of a thin part do not count.
  float FacingCount(const GridPoint& point) const {
    Eigen::Array4f sum = Eigen::Array4f::Zero();
    ForEachNode(point.u, [&](std::size_t node, float weight) { sum += weight * node_[node]; });
    return 0.5F * (sum[0] + point.normal.dot(Vec3f(sum[1], sum[2], sum[3])));
  }

 private:
  template <typename Visit>
  void ForEachNode(const Vec3f& u, Visit&& visit) const {
    // Shifted by one node so that the spline of a point on the border stays inside.
    const QuadraticSpline x(u[0] / cell_ + 1);
    const QuadraticSpline y(u[1] / cell_ + 1);
    const QuadraticSpline z(u[2] / cell_ + 1);
    for (std::size_t i = 0; i < 3; ++i) {
      for (std::size_t j = 0; j < 3; ++j) {
        const std::size_t row = ((static_cast<std::size_t>(x.first) + i) * nodes_[1] + static_cast<std::size_t>(y.first) + j) * nodes_[2] +
                                static_cast<std::size_t>(z.first);
        for (std::size_t k = 0; k < 3; ++k) visit(row + k, x.weight[i] * y.weight[j] * z.weight[k]);
      }
    }
  }

  float cell_;
  std::array<std::size_t, 3> nodes_;
  std::vector<Eigen::Array4f> node_;
};

}  // namespace

double MeanPointSpacing(const geometry::OrientedPoints& points) {
  geometry::Box3 box;
  for (const Vec3& x : points.positions) box.extend(x);
  const double extent = box.sizes().maxCoeff();
  if (!(extent > 0)) return 0;
  // Voxels small enough to follow the surface, large enough that the surface leaves hardly any without a point.
  double voxel = extent / 128;
  std::size_t occupied = CountOccupied(points, box.min(), voxel);
  while (occupied * 6 > points.size() && voxel < extent / 4) {
    voxel *= 1.5;
    occupied = CountOccupied(points, box.min(), voxel);
  }
  // A surface of unit area crosses |nx| + |ny| + |nz| voxels of unit face, 3/2 in the mean over directions; curvature and noise add some.
  const double area = static_cast<double>(occupied) * voxel * voxel / 1.6;
  return std::sqrt(area / static_cast<double>(points.size()));
}

void EstimateAreas(const GridFrame& frame, float mean_spacing, SortedPoints& points) {
  const float cell = 2 * mean_spacing;
  DensityGrid density(frame, cell);
  for (const GridPoint& point : points.points()) density.Add(point);
  // Splatting and gathering with a quadratic B-spline is nearly a Gaussian of variance 2/4 cells²; its integral over a plane through
  // its centre is 1 / (√(2π) σ), so that count × √(2π) σ is the number of points per cell² of surface.
  const float points_per_count = std::sqrt(2 * std::numbers::pi_v<float> * 0.5F);
  for (GridPoint& point : points.points()) point.area = cell * cell / (points_per_count * density.FacingCount(point));
}

}  // namespace vorocast::cvt
