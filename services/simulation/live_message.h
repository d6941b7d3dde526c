// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include "proto/simulation.pb.h"
#include "services/base/status.h"
#include "services/geometry/simulated_take.h"

namespace vorocast::simulation {

/// One instant as it travels: `now` holds that one only.
void Pack(const geometry::SimulatedTake& now, v1::LiveInstant& instant);
/// Appends the instant to a take of so many cells and objects. DATA_LOSS when the arrays do not fit them.
absl::Status Unpack(const v1::LiveInstant& instant, std::size_t cells, std::size_t objects, geometry::SimulatedTake& take);
/// Keeps the first `instants` only.
void Truncate(std::size_t instants, std::size_t cells, std::size_t objects, geometry::SimulatedTake& take);

}  // namespace vorocast::simulation
