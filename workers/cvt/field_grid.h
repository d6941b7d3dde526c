// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "services/geometry/vector.h"

namespace vorocast::cvt {

/// Where the nodes of a regular grid lie: node (i, j, k) at origin + spacing (i, j, k). k runs fastest in memory.
struct GridFrame {
  geometry::Vec3 origin = geometry::Vec3::Zero();  // metres
  double spacing = 1;                              // metres
  std::array<std::int32_t, 3> nodes = {0, 0, 0};

  std::size_t size() const { return static_cast<std::size_t>(nodes[0]) * static_cast<std::size_t>(nodes[1]) * static_cast<std::size_t>(nodes[2]); }
  std::size_t Index(std::int32_t i, std::int32_t j, std::int32_t k) const {
    return (static_cast<std::size_t>(i) * static_cast<std::size_t>(nodes[1]) + static_cast<std::size_t>(j)) * static_cast<std::size_t>(nodes[2]) +
           static_cast<std::size_t>(k);
  }
  /// A position in units of cells from the first node.
  geometry::Vec3f ToGrid(const geometry::Vec3& x) const { return ((x - origin) / spacing).cast<float>(); }
  geometry::Vec3 ToWorld(const geometry::Vec3f& u) const { return origin + spacing * u.cast<double>(); }
};

/// A function sampled at the nodes of a grid.
struct ScalarGrid {
  GridFrame frame;
  std::vector<float> value;  // [frame.size()]
};

/// The smallest grid of at least `spacing` metres around the box with `margin` metres on every side, whose sizes have no prime factor
/// above 7 (fast to transform) and whose product stays within `nodes_max`: the spacing grows until it does.
GridFrame FitGrid(const geometry::Box3& box, double spacing, double margin, std::int64_t nodes_max);

/// The trilinear interpolant at a position in grid units, clamped to the grid.
float Interpolate(const ScalarGrid& grid, const geometry::Vec3f& u);

}  // namespace vorocast::cvt
