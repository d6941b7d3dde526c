// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include "scheduler/core/state.h"
#include "scheduler/fleet/sizing.h"

namespace vorocast::server {

/// What is left to do for ordinary workers, and which of them there are. Reads every job's counts and no task.
fleet::Demand DemandOf(const core::State& state);

}  // namespace vorocast::server
