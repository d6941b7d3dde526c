// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <cstdint>
#include <vector>

#include "services/geometry/vector.h"

namespace vorocast::simulation {

/// Which parts of space are near something that recalled cells may collide with, on a coarse grid that is drawn anew at every step.
/// Errs on the side of near.
class Nearness {
 public:
  /// Clears the grid and lays it over `bounds`; marks outside fall away.
  void Reset(const geometry::Box3& bounds);
  void Mark(const geometry::Box3& box);
  /// Whether a cube around `centre` of half edge `radius` meets a mark.
  bool IsNear(const geometry::Vec3& centre, double radius) const;

 private:
  struct Range {
    int low[3];
    int high[3];  // inclusive
  };
  /// Voxels that a box meets; empty (low > high) when it lies outside the grid.
  Range Voxels(const geometry::Vec3& low, const geometry::Vec3& high) const;
  std::size_t Index(int x, int y, int z) const { return (static_cast<std::size_t>(z) * size_[1] + y) * size_[0] + x; }

  geometry::Vec3 origin_ = geometry::Vec3::Zero();
  double inverse_edge_ = 1;
  int size_[3] = {0, 0, 0};
  std::vector<std::uint8_t> marked_;
  bool any_ = false;
};

}  // namespace vorocast::simulation
