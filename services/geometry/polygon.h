// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "services/geometry/vector.h"

namespace vorocast::geometry {

/// Cuts a planar polygon without holes, convex or not, into triangles of its corners (indices into `corners`), in the polygon's own turn.
/// A polygon without area, or one that crosses itself, still gets its n − 2 triangles, somehow.
std::vector<std::array<std::int32_t, 3>> Triangulate(std::span<const Vec3> corners);

}  // namespace vorocast::geometry
