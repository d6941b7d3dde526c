// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <nlohmann/json.hpp>

#include "services/base/progress.h"
#include "services/base/status.h"
#include "services/geometry/simulated_take.h"
#include "services/simulation/effect_run.h"

namespace vorocast::simulation {

/// Runs one effect on a tracked take, start to end (paper, section 5): each cell a convex rigid body in Bullet, recalled to its tracked
/// pose by a damped spring, gravity, contacts, scene objects, rupture. The same input gives the same result on every run.
/// `target`: the take that an effect with a morph turns this one into (section 6.3), else null.
/// INVALID_ARGUMENT for a morph without a target, an effect that does not fit the schema, or a take whose arrays do not fit each other.
absl::StatusOr<geometry::SimulatedTake> Simulate(const geometry::TrackedTake& take, const nlohmann::json& effect, const base::Progress& progress,
                                                 const Cancelled& cancelled = {}, const geometry::TrackedTake* target = nullptr);

}  // namespace vorocast::simulation
