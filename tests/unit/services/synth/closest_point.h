// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include "services/geometry/triangle_mesh.h"

namespace vorocast::synth {

/// The distance from a point to a mesh, by brute force within a grid of cells: nothing of it is shared with what it tests.
class ClosestPoint {
 public:
  explicit ClosestPoint(geometry::TriangleMesh mesh) : mesh_(std::move(mesh)) {
    for (const geometry::Vec3& x : mesh_.vertices) box_.extend(x);
    for (int axis = 0; axis < 3; ++axis) size_[axis] = static_cast<int>(box_.sizes()[axis] / kCell_m) + 1;
    cells_.resize(static_cast<std::size_t>(size_[0]) * static_cast<std::size_t>(size_[1]) * static_cast<std::size_t>(size_[2]));
    for (std::size_t t = 0; t < mesh_.triangles.size(); ++t) {
      geometry::Box3 around;
      for (std::int32_t v : mesh_.triangles[t]) around.extend(mesh_.vertices[static_cast<std::size_t>(v)]);
      const Eigen::Vector3i low = CellOf(around.min()), high = CellOf(around.max());
      for (int k = low.z(); k <= high.z(); ++k) {
        for (int j = low.y(); j <= high.y(); ++j) {
          for (int i = low.x(); i <= high.x(); ++i) cells_[Index(i, j, k)].push_back(t);
        }
      }
    }
  }

  struct Found {
    double distance = 0;
    geometry::Vec3 normal = geometry::Vec3::Zero();  // of the nearest triangle
  };
  /// Exact up to 10 cm; 10 cm and no normal beyond that.
  Found Nearest(const geometry::Vec3& x) const {
    for (double reach : {0.01, 0.03, 0.10}) {
      const Found found = NearestWithin(x, reach);
      if (found.distance <= reach) return found;
    }
    return {0.10};
  }
  double Distance(const geometry::Vec3& x) const { return Nearest(x).distance; }

 private:
  static constexpr double kCell_m = 0.02;

  Eigen::Vector3i CellOf(const geometry::Vec3& x) const {
    Eigen::Vector3i cell;
    for (int axis = 0; axis < 3; ++axis) {
      cell[axis] = static_cast<int>(std::clamp(std::floor((x[axis] - box_.min()[axis]) / kCell_m), 0.0, size_[axis] - 1.0));
    }
    return cell;
  }
  std::size_t Index(int i, int j, int k) const {
    return (static_cast<std::size_t>(k) * static_cast<std::size_t>(size_[1]) + static_cast<std::size_t>(j)) * static_cast<std::size_t>(size_[0]) +
           static_cast<std::size_t>(i);
  }
  Found NearestWithin(const geometry::Vec3& x, double reach) const {
    Found nearest{1e9};
    if (box_.exteriorDistance(x) > reach) return nearest;
    const Eigen::Vector3i low = CellOf(x - geometry::Vec3::Constant(reach)), high = CellOf(x + geometry::Vec3::Constant(reach));
    for (int k = low.z(); k <= high.z(); ++k) {
      for (int j = low.y(); j <= high.y(); ++j) {
        for (int i = low.x(); i <= high.x(); ++i) {
          for (const std::size_t t : cells_[Index(i, j, k)]) {
            const Found found = ToTriangle(x, t);
            if (found.distance < nearest.distance) nearest = found;
          }
        }
      }
    }
    return nearest;
  }
  Found ToTriangle(const geometry::Vec3& x, std::size_t index) const {
    const auto& t = mesh_.triangles[index];
    const geometry::Vec3 corner[3] = {mesh_.vertices[static_cast<std::size_t>(t[0])], mesh_.vertices[static_cast<std::size_t>(t[1])],
                                      mesh_.vertices[static_cast<std::size_t>(t[2])]};
    const geometry::Vec3 normal = (corner[1] - corner[0]).cross(corner[2] - corner[0]).normalized();
    bool above = true;
    double nearest = 1e9;
    for (int i = 0; i < 3; ++i) {
      const geometry::Vec3 edge = corner[(i + 1) % 3] - corner[i];
      const geometry::Vec3 from = x - corner[i];
      above = above && normal.dot(edge.cross(from)) >= 0;
      nearest = std::min(nearest, (from - std::clamp(from.dot(edge) / edge.squaredNorm(), 0.0, 1.0) * edge).norm());
    }
    return {above ? std::abs(normal.dot(x - corner[0])) : nearest, normal};
  }

  geometry::TriangleMesh mesh_;
  geometry::Box3 box_;
  int size_[3] = {1, 1, 1};
  std::vector<std::vector<std::size_t>> cells_;
};

}  // namespace vorocast::synth
