// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <functional>

#include "absl/time/clock.h"
#include "absl/time/time.h"

namespace vorocast::base {

/// Tells the time; an argument wherever time matters, so that tests bring their own.
using Clock = std::function<absl::Time()>;

inline Clock SystemClock() {
  return [] { return absl::Now(); };
}

}  // namespace vorocast::base
