// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include "absl/time/time.h"
#include "scheduler/core/effects.h"
#include "scheduler/core/event.h"
#include "scheduler/core/state.h"

namespace vorocast::core {

/// The whole scheduler: what happened, and when, changes the state and asks for effects. No clock, thread, random source, socket or
/// database inside, so equal events give equal states. `now` never runs backwards.
Effects Step(State& state, Event event, absl::Time now);

}  // namespace vorocast::core
