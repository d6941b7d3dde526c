// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include "tests/bench/bench_report.h"
#include "workers/tracking/tracking.h"

namespace vorocast::bench {

/// Adds the case "tracking-frame-solve": one frame's poses with fixed partners, from `start`, by tracking's own equations and by Ceres.
void CompareWithCeres(const geometry::Template& model, const tracking::Observation& frame, const std::vector<geometry::Rigid3>& start,
                      BenchReport& report);

}  // namespace vorocast::bench
