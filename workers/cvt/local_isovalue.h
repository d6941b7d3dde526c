// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include "workers/cvt/field_grid.h"
#include "workers/cvt/sorted_points.h"

namespace vorocast::cvt {

/// Shifts an indicator so that its zero set runs through the points: by its mean over all points, and near points by their own mean as
/// well. Where a part is thinner than the smoothing, or its normals disagree, the indicator rises less than elsewhere; the
/// common isovalue would lose that part, its own keeps it.
void SubtractLocalIsovalue(const SortedPoints& points, ScalarGrid& indicator);

}  // namespace vorocast::cvt
