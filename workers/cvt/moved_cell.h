// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "services/geometry/vector.h"
#include "workers/cvt/convex_cell.h"

namespace vorocast::cvt {

/// A finished cell's corner; as ConvexCell::Corner, but smaller.
struct CellCorner {
  geometry::Vec3 position;
  std::array<std::uint16_t, 3> plane;
  std::array<std::uint16_t, 3> next;
};

/// A cell whose planes have moved, on the guess that they still meet as they did: that is much cheaper to check than to find out anew, and
/// from one iteration to the next it holds for most cells.
class MovedCell {
 public:
  /// Computes where the planes meet. False when these corners are not those of the polyhedron that the planes bound. The guess holds exactly
  /// when every corner is a proper one and lies beyond no plane: the corners are then corners of that polyhedron, each with its three
  /// neighbours among them, and so all there are.
  bool Find(std::span<const HalfSpace> planes, std::span<const CellCorner> corners);

  double RadiusSquared() const { return radius_squared_; }
  /// Whether some corner lies beyond the plane through p across p.
  bool IsCutBy(const geometry::Vec3& p) const;
  geometry::Vec3 position(std::int32_t i) const { return {x_[i], y_[i], z_[i]}; }

 private:
  std::int32_t padded_count_ = 0;
  std::vector<double> x_, y_, z_;  // [padded_count]; padded by the last corner
  double radius_squared_ = 0;
};

}  // namespace vorocast::cvt
