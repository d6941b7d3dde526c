// SPDX-License-Identifier: AGPL-3.0-or-later
#include "services/simulation/nearness.h"

#include <algorithm>
#include <cmath>

namespace vorocast::simulation {

using geometry::Box3;
using geometry::Vec3;

void Nearness::Reset(const Box3& bounds) {
  constexpr double kEdgeMin = 0.02;  // metres, about a cell
  constexpr double kVoxelsMax = 200000;
  const Vec3 size = bounds.sizes().cwiseMax(kEdgeMin);
  const double edge = std::max(kEdgeMin, std::cbrt(size.prod() / kVoxelsMax));
  origin_ = bounds.min();
  inverse_edge_ = 1 / edge;
  for (int axis = 0; axis < 3; ++axis) size_[axis] = static_cast<int>(size[axis] * inverse_edge_) + 1;
  marked_.assign(static_cast<std::size_t>(size_[0]) * size_[1] * size_[2], 0);
  any_ = false;
}

Nearness::Range Nearness::Voxels(const Vec3& low, const Vec3& high) const {
  Range range{};
  for (int axis = 0; axis < 3; ++axis) {
    // Clamped before the cast: far away does not fit an int.
    const double last = size_[axis] - 1;
    const double from = std::floor((low[axis] - origin_[axis]) * inverse_edge_);
    const double to = std::floor((high[axis] - origin_[axis]) * inverse_edge_);
    range.low[axis] = static_cast<int>(std::clamp(from, 0.0, last + 1));
    range.high[axis] = static_cast<int>(std::clamp(to, -1.0, last));
  }
  return range;
}

void Nearness::Mark(const Box3& box) {
  const auto [low, high] = Voxels(box.min(), box.max());
  if (low[0] > high[0]) return;
  for (int z = low[2]; z <= high[2]; ++z) {
    for (int y = low[1]; y <= high[1]; ++y) {
      std::fill_n(marked_.begin() + static_cast<std::ptrdiff_t>(Index(low[0], y, z)), high[0] - low[0] + 1, std::uint8_t{1});
      any_ = true;
    }
  }
}

bool Nearness::IsNear(const Vec3& centre, double radius) const {
  if (!any_) return false;
  const auto [low, high] = Voxels(centre - Vec3::Constant(radius), centre + Vec3::Constant(radius));
  for (int z = low[2]; z <= high[2]; ++z) {
    for (int y = low[1]; y <= high[1]; ++y) {
      for (int x = low[0]; x <= high[0]; ++x) {
        if (marked_[Index(x, y, z)] != 0) return true;
      }
    }
  }
  return false;
}

}  // namespace vorocast::simulation
