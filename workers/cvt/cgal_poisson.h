// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include "services/base/status.h"
#include "services/geometry/oriented_points.h"
#include "workers/cvt/field_grid.h"

namespace vorocast::cvt {

/// CGAL's Poisson indicator (positive inside, zero at the points' median) sampled at the nodes of a grid: the reference that the spectral
/// solution is tested against. INTERNAL when its solver fails.
absl::StatusOr<ScalarGrid> SampleCgalPoisson(const GridFrame& frame, const geometry::OrientedPoints& points);

}  // namespace vorocast::cvt
