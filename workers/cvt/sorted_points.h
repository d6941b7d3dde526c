// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <vector>

#include "services/geometry/oriented_points.h"
#include "workers/cvt/field_grid.h"

namespace vorocast::cvt {

/// An oriented point in the units of a grid.
struct GridPoint {
  geometry::Vec3f u;       // position in cells
  geometry::Vec3f normal;  // unit, outward
  float area = 0;          // of the surface it stands for, in cells²
};

/// Points in grid units, put in the order of coarse buckets so that neighbours in space are neighbours in memory.
/// The order is a function of the input alone.
class SortedPoints {
 public:
  /// Buckets are cubes of `bucket` grid cells.
  SortedPoints(const geometry::OrientedPoints& points, const GridFrame& frame, float bucket);

  const std::vector<GridPoint>& points() const { return points_; }
  std::vector<GridPoint>& points() { return points_; }

  /// Calls visit(point) for every point in the buckets that touch the ball around `u`, and so for some outside the ball too.
  template <typename Visit>
  void ForEachNear(const geometry::Vec3f& u, float radius, Visit&& visit) const {
    std::array<std::int32_t, 3> low;
    std::array<std::int32_t, 3> high;
    for (int a = 0; a < 3; ++a) {
      const std::size_t axis = static_cast<std::size_t>(a);
      low[axis] = std::clamp(static_cast<std::int32_t>(std::floor((u[a] - radius) / bucket_)), 0, buckets_[axis] - 1);
      high[axis] = std::clamp(static_cast<std::int32_t>(std::floor((u[a] + radius) / bucket_)), 0, buckets_[axis] - 1);
    }
    for (std::int32_t i = low[0]; i <= high[0]; ++i) {
      for (std::int32_t j = low[1]; j <= high[1]; ++j) {
        // Buckets along the last axis follow one another, so one run of points covers them all.
        const std::size_t end = static_cast<std::size_t>(first_[BucketIndex(i, j, high[2]) + 1]);
        for (std::size_t p = static_cast<std::size_t>(first_[BucketIndex(i, j, low[2])]); p < end; ++p) visit(points_[p]);
      }
    }
  }

 private:
  std::size_t BucketIndex(std::int32_t i, std::int32_t j, std::int32_t k) const {
    return (static_cast<std::size_t>(i) * static_cast<std::size_t>(buckets_[1]) + static_cast<std::size_t>(j)) *
               static_cast<std::size_t>(buckets_[2]) +
           static_cast<std::size_t>(k);
  }

  float bucket_;
  std::array<std::int32_t, 3> buckets_;
  std::vector<std::int32_t> first_;  // [buckets + 1]
  std::vector<GridPoint> points_;
};

}  // namespace vorocast::cvt
