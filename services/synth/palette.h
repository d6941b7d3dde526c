// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include "services/geometry/oriented_points.h"
#include "services/synth/synth.h"

namespace vorocast::synth {

/// The colour of a part at a place of its rest shape (metres): sleeves end at the elbow, stockings at the knee, eyes where eyes are.
geometry::Rgb8 ColourOf(Part part, const geometry::Vec3& at_rest);

}  // namespace vorocast::synth
