// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "services/geometry/vector.h"

namespace vorocast::geometry {

using Rgb8 = std::array<std::uint8_t, 3>;

/// A captured frame as points on the surface with outward unit normals. Nothing corresponds between frames.
struct OrientedPoints {
  std::vector<Vec3> positions;
  std::vector<Vec3> normals;  // as many as positions
  std::vector<Rgb8> colours;  // as many as positions, or empty

  std::size_t size() const { return positions.size(); }
};

}  // namespace vorocast::geometry
