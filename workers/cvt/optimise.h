// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "services/base/progress.h"
#include "services/base/status.h"
#include "services/geometry/vector.h"
#include "workers/cvt/clipped_cells.h"

namespace vorocast::cvt {

struct OptimiseSummary {
  std::int32_t iterations = 0;
  std::int32_t evaluations = 0;
  double energy_start = 0;
  double energy = 0;
  double gradient_norm = 0;
  std::string why_stopped;  // "iterations", "gradient", "no progress"
};

/// Lowers the CVT energy of the sites (paper, section 3.2 and step 3 of section 3.3) by at most `iterations` steps of L-BFGS (Nocedal & Wright,
/// algorithm 7.4; for CVT: Liu et al. 2009), preconditioned by 1 / 2m, with which its first step is Lloyd's. The energy never rises.
/// On return the last evaluation of `cells` is that of `sites`, and `complex` holds it.
absl::StatusOr<OptimiseSummary> Optimise(const Solid& solid, std::int32_t iterations, ClippedCells* cells, std::vector<geometry::Vec3>* sites,
                                         ClippedComplex* complex, const base::Progress& progress);

}  // namespace vorocast::cvt
