// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include "services/geometry/oriented_points.h"
#include "workers/cvt/sorted_points.h"

namespace vorocast::cvt {

/// The mean distance between neighbouring points, √(area / count), in metres; the area is that of the voxels the points occupy.
/// Zero for fewer than two distinct positions.
double MeanPointSpacing(const geometry::OrientedPoints& points);

/// Sets each point's area from the density of the points around it that face the same way (Kazhdan's sample weights), so that a scan that is
/// dense here and sparse there gives an even field. `mean_spacing` in grid cells sets the reach: about 25 points at the mean density.
void EstimateAreas(const GridFrame& frame, float mean_spacing, SortedPoints& points);

}  // namespace vorocast::cvt
