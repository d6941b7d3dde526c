// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <cstdint>
#include <string>
#include <variant>

#include "absl/time/time.h"
#include "scheduler/core/cause.h"
#include "services/base/digest.h"
#include "services/tasks/task.h"

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

/// What became of one attempt at a task; of an attempt that several jobs waited for, one for each of their tasks. Nothing is decided by it:
/// it is kept for those who ask afterwards.
struct AttemptEnded {
  enum class Outcome : std::uint8_t { kDone, kFailed, kCancelled };
  std::string job;
  std::string task;  // its name in the plan
  tasks::Kind kind = tasks::Kind::kTessellate;
  std::int64_t attempt = 0;
  std::string worker;
  absl::Duration lasted;
  absl::Time ended = absl::UnixEpoch();  // by the wall clock, which the core does not have: whoever puts it on record says
  Outcome outcome = Outcome::kDone;
  Cause cause = Cause::kInternal;  // of a failure, like `message`
  std::string message;
  double cpu_seconds = 0;        // this and what follows as the worker told; 0 and empty if it did not come to that
  std::int64_t memory_peak = 0;  // bytes
  std::string log;               // the end of what it printed
};

using Record =
    std::variant<ResultMade, TaskFailed, RunSaved, RunEnded, AttemptsReserved, JobCancelled, JobRetried, JobPaused, JobLimited, AttemptEnded>;

}  // namespace vorocast::core
