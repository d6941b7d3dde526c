// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include "workers/cvt/field_grid.h"
#include "workers/cvt/sorted_points.h"

namespace vorocast::cvt {

/// The Poisson indicator of area-weighted oriented points on a periodic grid: about 1 inside, 0 outside, up to a constant (Kazhdan 2006;
/// solved by Fourier transforms as in Peng 2021). `smoothing` is the standard deviation in cells of the Gaussian that the step is smoothed by;
/// the splines the points are spread with give 0.58 already, which is the least.
/// Deterministic; single-threaded; safe to call from several threads.
ScalarGrid SolveSpectralPoisson(const GridFrame& frame, const SortedPoints& points, double smoothing);

}  // namespace vorocast::cvt
