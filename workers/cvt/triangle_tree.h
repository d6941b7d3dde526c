// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <array>
#include <cstdint>
#include <limits>
#include <vector>

#include "services/geometry/vector.h"

namespace vorocast::cvt {

/// The point of the triangle abc nearest to p (Ericson, Real-Time Collision Detection, 5.1.5).
geometry::Vec3 NearestOnTriangle(const geometry::Vec3& p, const geometry::Vec3& a, const geometry::Vec3& b, const geometry::Vec3& c);

/// A bounding volume hierarchy for exact distances to a triangle mesh.
class TriangleTree {
 public:
  /// Keeps references: both must outlive the tree. There must be at least one triangle.
  TriangleTree(const std::vector<geometry::Vec3>& vertices, const std::vector<std::array<std::int32_t, 3>>& triangles);

  /// From the point to the surface, metres, never negative. A distance known not to be exceeded saves most of the search.
  double Distance(const geometry::Vec3& point, double at_most = std::numeric_limits<double>::infinity()) const;

 private:
  struct Node {
    geometry::Box3 box;
    std::int32_t begin, end;  // of order_
    std::int32_t right;       // the left child follows its parent; 0 for a leaf
  };
  struct Item {
    geometry::Vec3f middle;
    std::int32_t triangle;
  };
  std::int32_t Split(std::int32_t begin, std::int32_t end, std::vector<Item>& items);
  double SquaredDistanceTo(std::int32_t triangle, const geometry::Vec3& point) const;

  const std::vector<geometry::Vec3>& vertices_;
  const std::vector<std::array<std::int32_t, 3>>& triangles_;
  std::vector<std::int32_t> order_;
  std::vector<Node> nodes_;
};

}  // namespace vorocast::cvt
