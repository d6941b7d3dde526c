// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <cstdint>
#include <string_view>

#include "absl/time/time.h"

namespace vorocast::core {

/// Why an attempt ended without a result.
enum class Cause : std::uint8_t {
  kInput,        // the input itself is bad: the same on every attempt
  kCrashed,      // killed by a signal
  kOutOfMemory,  // reached its memory limit
  kTimedOut,     // reached its time limit
  kStore,        // the artifact folder could not be read or written
  kInternal,     // anything else
  kDrained,      // the worker is leaving and gave the task back
  kWorkerLost,   // no sign of life from the worker
  kNeeds,        // never started: something that it reads could not be made
};
std::string_view Name(Cause cause);

/// What a task has been through; kept over restarts.
struct Tries {
  std::int32_t failed = 0;         // attempts whose own doing it was
  std::int32_t interrupted = 0;    // attempts that the machines around it ended
  std::int32_t memory_raised = 0;  // how often the memory limit was doubled
  std::int32_t time_raised = 0;    // how often the time limit was doubled
};

struct Verdict {
  bool again = false;
  absl::Duration rest = absl::ZeroDuration();  // before the next attempt
};

inline constexpr std::int32_t kFailedMax = 3;
inline constexpr std::int32_t kInterruptedMax = 10;
inline constexpr std::int32_t kMemoryRaisedMax = 1;
inline constexpr std::int32_t kTimeRaisedMax = 1;

/// The limits that the ended attempt was given: with two at once they may be lower than what the next one gets.
struct Raised {
  std::int32_t memory = 0;
  std::int32_t time = 0;
};
/// The one place that sorts causes: enters the ended attempt in `tries` and says whether another makes sense.
Verdict Judge(Cause cause, const Raised& given, Tries& tries);
/// Whether the worker could be the reason: another might do better.
bool CouldBeTheWorkers(Cause cause);

}  // namespace vorocast::core
