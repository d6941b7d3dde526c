// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "services/geometry/vector.h"

namespace vorocast::tracking {

/// A template point in its present pose, relative to the grid's origin. Single precision holds 0.1 µm over a metre, and half the memory is most of
/// the speed of association.
struct PosedPoint {
  geometry::Vec3f position;
  geometry::Vec3f normal;  // zero for inner points
  float depth = 0;         // zero for surface points
  std::int32_t patch = 0;
};

/// A uniform grid over posed points. Points of cells that follow each other along x follow each other in memory.
class PointGrid {
 public:
  /// Rebuilds the grid over `points`; cells are `cell_m` wide, or wider when the points are so spread out that there would be too many cells.
  void Build(const std::vector<PosedPoint>& points, float cell_m);

  /// Calls visit(point) for every point in the 27 cells around `x`: all within cell_m of it, and some others.
  template <typename Visit>
  void VisitNear(const geometry::Vec3f& x, Visit visit) const {
    const geometry::Vec3f cell = (x - low_) * inverse_cell_;
    if (!((cell.array() > -1).all() && (cell.array() < (size_.cast<float>().array() + 1)).all())) return;
    const Eigen::Vector3i at(static_cast<int>(cell.x() + 1) - 1, static_cast<int>(cell.y() + 1) - 1, static_cast<int>(cell.z() + 1) - 1);
    const int x0 = std::max(at.x() - 1, 0);
    const int x1 = std::min(at.x() + 1, size_.x() - 1);
    if (x0 > x1) return;
    for (int z = std::max(at.z() - 1, 0); z <= std::min(at.z() + 1, size_.z() - 1); ++z) {
      for (int y = std::max(at.y() - 1, 0); y <= std::min(at.y() + 1, size_.y() - 1); ++y) {
        const std::size_t row = (static_cast<std::size_t>(z) * size_.y() + y) * size_.x();
        for (std::int32_t i = start_[row + x0]; i < start_[row + x1 + 1]; ++i) visit(points_[i]);
      }
    }
  }

 private:
  geometry::Vec3f low_ = geometry::Vec3f::Zero();
  float inverse_cell_ = 1;
  Eigen::Vector3i size_ = Eigen::Vector3i::Zero();
  std::vector<std::int32_t> start_;  // [cells+1]
  std::vector<PosedPoint> points_;
};

}  // namespace vorocast::tracking
