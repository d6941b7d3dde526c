// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <cstdint>
#include <string>
#include <variant>

#include "scheduler/core/cause.h"
#include "services/base/digest.h"

/// What the core wants kept over a restart. Every record may be written twice without harm.
namespace vorocast::core {

/// A file that a task made, published under the task's key.
struct Result {
  base::Digest sha256;
  std::int64_t size = 0;
  double seconds = 0;  // wall clock of the attempt that made it
  double cpu_seconds = 0;
  std::int64_t memory_peak = 0;  // bytes
  std::string made_for;          // id of the job that it was made for
};

struct ResultMade {
  base::Digest key;
  Result result;
};
/// Of a task's own doing; a failure that follows from another task's is not kept, since it follows again.
struct TaskFailed {
  std::string job;
  std::string task;  // its name in the plan
  Cause cause = Cause::kInternal;
  std::string message;
};
/// A run with something worth remembering: who holds it under which attempt, and what it has been through.
struct RunSaved {
  base::Digest key;
  std::int64_t attempt = 0;
  std::string worker;  // empty: nobody holds it
  Tries tries;
  std::int64_t copy_attempt = 0;  // the second attempt at a task that takes long
  std::string copy_worker{};      // empty: there is none
};
struct RunEnded {
  base::Digest key;
};
/// Attempt numbers below this one may have been given out. They are never used twice, over all tasks and restarts.
struct AttemptsReserved {
  std::int64_t next = 1;
};
struct JobCancelled {
  std::string job;
};
/// Forgets the job's failures and that it was cancelled.
struct JobRetried {
  std::string job;
};
struct JobPaused {
  std::string job;
  bool paused = true;  // false: it goes on
};
/// The limits of the job's next attempts.
struct JobLimited {
  std::string job;
  std::int64_t memory_limit = 0;  // as in JobTerms
  double time_factor = 1;
};

/// What a user asks of a job besides its results: they decide when it runs and how far its tasks may go, and nothing of what is computed.
struct JobTerms {
  std::int32_t workers_max = 0;   // attempts of this job that run at once; 0: any number
  double deadline = 0;            // seconds since 1970 by which it should have ended; 0: none
  std::int64_t memory_limit = 0;  // bytes a task may take; 0: the service's own limit
  double time_factor = 1;         // the usual time limits times this
};

using Record = std::variant<ResultMade, TaskFailed, RunSaved, RunEnded, AttemptsReserved, JobCancelled, JobRetried, JobPaused, JobLimited>;

}  // namespace vorocast::core
