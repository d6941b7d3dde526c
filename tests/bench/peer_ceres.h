// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include "tests/bench/frame_problem.h"

namespace vorocast::bench {

/// The same problem with Ceres as one would first write it: a residual block a point and one an edge, automatic derivatives, unit quaternions on
/// their manifold, Levenberg–Marquardt with SuiteSparse's Cholesky, one thread.
FrameSolution SolveWithCeres(const FrameProblem& problem);

}  // namespace vorocast::bench
