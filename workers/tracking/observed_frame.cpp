// SPDX-License-Identifier: AGPL-3.0-or-later
#include "workers/tracking/observed_frame.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <utility>

namespace vorocast::tracking {
namespace {

using geometry::Vec3;

/// Spreads the low 21 bits of x to every third bit.
std::uint64_t Spread(std::uint64_t x) {
  x &= 0x1fffff;
  x = (x | x << 32) & 0x1f00000000ffffULL;
  x = (x | x << 16) & 0x1f0000ff0000ffULL;
  x = (x | x << 8) & 0x100f00f00f00f00fULL;
  x = (x | x << 4) & 0x10c30c30c30c30c3ULL;
  x = (x | x << 2) & 0x1249249249249249ULL;
  return x;
}

/// Indices of the points in Morton order of 5 mm cubes; equal codes keep their order.
std::vector<std::int32_t> MortonOrder(const std::vector<Vec3>& points) {
  constexpr double kCubeM = 0.005;
  geometry::Box3 box;
  for (const Vec3& p : points) box.extend(p);
  std::vector<std::pair<std::uint64_t, std::int32_t>> keys;
  keys.reserve(points.size());
  for (std::size_t i = 0; i < points.size(); ++i) {
    const Vec3 cube = ((points[i] - box.min()) / kCubeM).cwiseMin(2097151.0);
    keys.emplace_back(Spread(static_cast<std::uint64_t>(cube.x())) | Spread(static_cast<std::uint64_t>(cube.y())) << 1 |
                          Spread(static_cast<std::uint64_t>(cube.z())) << 2,
                      static_cast<std::int32_t>(i));
  }
  std::ranges::sort(keys);
  std::vector<std::int32_t> order;
  order.reserve(keys.size());
  for (const auto& key : keys) order.push_back(key.second);
  return order;
}

}  // namespace

absl::StatusOr<ObservedFrame> PrepareObservation(const Observation& observation) {
  ObservedFrame frame;
  if (observation.missing) return frame;
  if (observation.surface.positions.size() != observation.surface.normals.size() || observation.inner.size() != observation.inner_depth.size()) {
    return absl::InvalidArgumentError(fmt::format("frame {}: {} surface points with {} normals and {} inner points with {} depths; each needs one",
                                                  observation.frame, observation.surface.positions.size(), observation.surface.normals.size(),
                                                  observation.inner.size(), observation.inner_depth.size()));
  }
  std::vector<Vec3> position;
  std::vector<Vec3> normal;
  for (std::size_t i = 0; i < observation.surface.positions.size(); ++i) {
    const double length = observation.surface.normals[i].norm();
    // A reader may leave a few bad points in; they say nothing about the shape.
    if (!observation.surface.positions[i].allFinite() || !(length > 1e-6) || !std::isfinite(length)) continue;
    position.push_back(observation.surface.positions[i]);
    normal.push_back(observation.surface.normals[i] / length);
  }
  for (const std::int32_t i : MortonOrder(position)) {
    frame.position.push_back(position[i]);
    frame.normal.push_back(normal[i]);
  }
  for (std::size_t i = 0; i < observation.inner.size(); ++i) {
    if (!observation.inner[i].allFinite() || !std::isfinite(observation.inner_depth[i])) continue;
    frame.inner.push_back(observation.inner[i]);
    frame.inner_depth.push_back(observation.inner_depth[i]);
  }
  return frame;
}

}  // namespace vorocast::tracking
