// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <cstdint>
#include <vector>

#include "scheduler/plan/plan.h"

/// The film's part of a job: a task for every picture, and one for the movie.
namespace vorocast::plan {

/// How many instants the take that is rendered has: its frames, or what the effect stores of itself (its duration and rate, services/simulation).
/// `frames` are ordered.
std::int32_t FilmPictures(const JobSpec& job, const std::vector<PlannedFrame>& frames);

/// `tracked` and `simulated`: names of the tasks that make them; `simulated` empty without an effect. RESOURCE_EXHAUSTED for more pictures than a
/// job may have.
absl::StatusOr<std::vector<PlannedTask>> Film(const JobSpec& job, const std::vector<PlannedFrame>& frames, const std::string& tracked,
                                              const std::string& simulated);

}  // namespace vorocast::plan
