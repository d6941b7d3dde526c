// SPDX-License-Identifier: AGPL-3.0-or-later
#include "scheduler/core/cause.h"

#include <algorithm>

#include "services/base/check.h"

namespace vorocast::core {

std::string_view Name(Cause cause) {
  switch (cause) {
    case Cause::kInput:
      return "bad input";
    case Cause::kCrashed:
      return "crashed";
    case Cause::kOutOfMemory:
      return "out of memory";
    case Cause::kTimedOut:
      return "took too long";
    case Cause::kStore:
      return "artifact folder unreachable";
    case Cause::kInternal:
      return "failed";
    case Cause::kDrained:
      return "given back";
    case Cause::kWorkerLost:
      return "worker lost";
    case Cause::kNeeds:
      return "not started";
  }
  VOROCAST_CHECK(false && "unknown cause");
}

bool CouldBeTheWorkers(Cause cause) { return cause == Cause::kCrashed || cause == Cause::kStore || cause == Cause::kInternal; }

namespace {

/// Reaching a limit is worth one attempt under twice that limit.
bool Raise(std::int32_t given, std::int32_t max, std::int32_t& raised, std::int32_t failed) {
  if (given < raised) return failed < kFailedMax;  // raised already since this attempt began
  return raised < max && ++raised > 0;
}

}  // namespace

Verdict Judge(Cause cause, const Raised& given, Tries& tries) {
  switch (cause) {
    case Cause::kInput:
    case Cause::kNeeds:
      ++tries.failed;
      return {.again = false};
    case Cause::kOutOfMemory:
      ++tries.failed;
      return {.again = Raise(given.memory, kMemoryRaisedMax, tries.memory_raised, tries.failed)};
    case Cause::kTimedOut:
      ++tries.failed;
      return {.again = Raise(given.time, kTimeRaisedMax, tries.time_raised, tries.failed)};
    case Cause::kCrashed:
    case Cause::kInternal:
      return {.again = ++tries.failed < kFailedMax};
    case Cause::kStore:
      ++tries.interrupted;
      // A folder that is away for a while comes back; asking for it at full speed would only use up the attempts.
      return {.again = tries.interrupted <= kInterruptedMax, .rest = absl::Seconds(std::min(1 << std::min(tries.interrupted - 1, 5), 30))};
    case Cause::kDrained:
    case Cause::kWorkerLost:
      return {.again = ++tries.interrupted <= kInterruptedMax};
  }
  VOROCAST_CHECK(false && "unknown cause");
}

}  // namespace vorocast::core
