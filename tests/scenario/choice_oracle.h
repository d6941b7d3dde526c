// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <cstdint>

#include "scheduler/core/state.h"
#include "services/base/status.h"

namespace vorocast::scenario {

/// Says anew, by looking at every run, what each lease of a step should have been, and compares. `attempt_next` is the state's from before the step.
/// By the rules alone: the largest priority; then the user with the fewest slots at work; then the earliest deadline, the oldest job, the order of
/// the plan; nothing of a paused job or past a limit. A second attempt needs a first one elsewhere, and nothing else for its worker to do.
absl::Status CheckChoices(const core::State& state, std::int64_t attempt_next);

}  // namespace vorocast::scenario
