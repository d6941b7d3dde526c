// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <cstdint>
#include <vector>

#include "services/geometry/vector.h"
#include "workers/cvt/solid.h"

namespace vorocast::cvt {

/// `count` points uniform in the solid (paper, section 3.3, step 1).
std::vector<geometry::Vec3> RandomSites(const Solid& solid, std::int32_t count, std::uint64_t seed);

/// `count` points of a body-centred cubic lattice in the solid, its spacing fitted to the count, moved by a hundredth of the spacing: what
/// optimisation ends up with far from the surface, up to grain boundaries, so it starts most of the way there.
std::vector<geometry::Vec3> LatticeSites(const Solid& solid, std::int32_t count, std::uint64_t seed);

}  // namespace vorocast::cvt
