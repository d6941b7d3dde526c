// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include "scheduler/core/state.h"
#include "services/base/status.h"

namespace vorocast::core {

/// Counts everything again and compares it with what the state says of itself. INTERNAL names the first contradiction.
/// For tests: it looks at every task. With `keys` it also computes every key again, which takes most of the time.
absl::Status Check(const State& state, bool keys = true);

}  // namespace vorocast::core
