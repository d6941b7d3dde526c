// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <vector>

#include "services/geometry/vector.h"
#include "workers/cvt/shape.h"
#include "workers/cvt/x_rays.h"

namespace vorocast::cvt {

/// One connected solid of a shape with its own compact surface; the kernels work on one solid at a time, so cells never span two.
struct Solid {
  std::vector<geometry::Vec3> vertices;
  std::vector<std::array<std::int32_t, 3>> triangles;
  geometry::Box3 box;
  double volume = 0;  // m³

  /// The edge length of a cube that holds one cell's share of the volume.
  double Spacing(std::size_t cells) const;
};

/// Component `component` of a shape, with vertices numbered by their first use.
Solid SolidOf(const Shape& shape, std::int32_t component);

}  // namespace vorocast::cvt
