// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <filesystem>
#include <map>
#include <string>

#include "tests/bench/paper_takes.h"

namespace vorocast::bench {

/// The paper's paragraph on run time ("Run Time Performance"), CPU seconds of one thread, with the paper's parameters (5000 cells, 200 patches,
/// windows of 10 frames): "poisson" and "cells" a frame, "template", "tracking" a frame (guide, window and assembly), "simulation" a step (pendulum,
/// from the hit on; steps of 1/240 s). Writes the tracked take to `tracked_file`.
absl::StatusOr<std::map<std::string, double>> MeasureRunTime(const PaperTake& take, const std::filesystem::path& tracked_file);

}  // namespace vorocast::bench
