// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <cstdint>

#include "services/geometry/oriented_points.h"
#include "services/geometry/vector.h"

namespace vorocast::rendering {

/// Colours are linear RGB in [0, 1] until a pixel is written.
geometry::Vec3f LinearFromRgb8(const geometry::Rgb8& colour);
geometry::Rgb8 Rgb8FromLinear(const geometry::Vec3f& colour);

/// A soft colour for a patch or cell: hues of following indices lie far apart, and their lightness changes too.
geometry::Vec3f PatchColour(std::int32_t index);

}  // namespace vorocast::rendering
