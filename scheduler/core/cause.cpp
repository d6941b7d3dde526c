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

Verdict Judge(Cause cause, Tries& tries) {
  switch (cause) {
    case Cause::kInput:
    case Cause::kNeeds:
      ++tries.failed;
      return {.again = false};
    case Cause::kOutOfMemory:
      ++tries.failed;
      return {.again = tries.memory_raised++ < kMemoryRaisedMax};
    case Cause::kCrashed:
    case Cause::kTimedOut:
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
