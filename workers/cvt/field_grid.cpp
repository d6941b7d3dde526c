// SPDX-License-Identifier: AGPL-3.0-or-later
#include "workers/cvt/field_grid.h"

#include <algorithm>
#include <cmath>

namespace vorocast::cvt {
namespace {

std::int32_t NextFastSize(std::int32_t least) {
  for (std::int32_t n = std::max(least, 8);; ++n) {
    std::int32_t rest = n;
    for (std::int32_t prime : {2, 3, 5, 7}) {
      while (rest % prime == 0) rest /= prime;
    }
    if (rest == 1) return n;
  }
}

}  // namespace

GridFrame FitGrid(const geometry::Box3& box, double spacing, double margin, std::int64_t nodes_max) {
  const geometry::Vec3 extent = box.sizes() + geometry::Vec3::Constant(2 * margin);
  // A first jump close to the limit, so that the loop below only has to make up for the rounding of the sizes.
  spacing = std::max(spacing, std::cbrt(extent.prod() / static_cast<double>(nodes_max)));
  for (;; spacing *= 1.02) {
    GridFrame frame;
    frame.spacing = spacing;
    for (int a = 0; a < 3; ++a)
      frame.nodes[static_cast<std::size_t>(a)] = NextFastSize(static_cast<std::int32_t>(std::ceil(extent[a] / spacing)) + 1);
    if (static_cast<std::int64_t>(frame.size()) > nodes_max) continue;
    const geometry::Vec3 covered = spacing * geometry::Vec3(frame.nodes[0] - 1, frame.nodes[1] - 1, frame.nodes[2] - 1);
    frame.origin = box.center() - covered / 2;
    return frame;
  }
}

float Interpolate(const ScalarGrid& grid, const geometry::Vec3f& u) {
  std::array<std::int32_t, 3> cell;
  geometry::Vec3f t;
  for (int a = 0; a < 3; ++a) {
    const std::size_t axis = static_cast<std::size_t>(a);
    cell[axis] = std::clamp(static_cast<std::int32_t>(std::floor(u[a])), 0, grid.frame.nodes[axis] - 2);
    t[a] = std::clamp(u[a] - static_cast<float>(cell[axis]), 0.0F, 1.0F);
  }
  const auto along_k = [&](std::int32_t i, std::int32_t j) {
    const float* row = &grid.value[grid.frame.Index(cell[0] + i, cell[1] + j, cell[2])];
    return row[0] + t[2] * (row[1] - row[0]);
  };
  const float low = along_k(0, 0) + t[1] * (along_k(0, 1) - along_k(0, 0));
  const float high = along_k(1, 0) + t[1] * (along_k(1, 1) - along_k(1, 0));
  return low + t[0] * (high - low);
}

}  // namespace vorocast::cvt
