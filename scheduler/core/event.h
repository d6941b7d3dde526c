// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "scheduler/core/record.h"
#include "scheduler/plan/plan.h"
#include "services/tasks/task.h"

namespace vorocast::core {

/// One stream of a worker. Never used twice by one scheduler process; 0 is none.
using ConnectionId = std::uint64_t;

struct AttemptId {
  base::Digest key;
  std::int64_t attempt = 0;
  auto operator<=>(const AttemptId&) const = default;
};

// What happens to the scheduler.

/// First event after a start: what the store remembers.
struct Restored {
  std::vector<RunSaved> runs;
  std::int64_t attempt_next = 1;
};
struct JobSubmitted {
  std::string id;
  std::string name;  // of the take, for people
  std::string user;
  std::int32_t priority = 0;  // larger first
  JobTerms terms{};
  bool paused = false;
  // After a restart: what became of it before.
  bool cancelled = false;
  std::vector<TaskFailed> failures;
  bool verify = false;  // its existing results are read and held against their digests
};
/// Tasks of a submitted job, each after those it reads. Names that the job has already are passed over.
struct TasksAdded {
  std::string job;
  std::vector<plan::PlannedTask> tasks;
  bool complete = false;                  // none will follow
  std::int32_t bad_frames_max = -1;       // more frames than this that fail stop the job; negative: not known yet
  std::optional<std::string> impossible;  // the rest of the job cannot be planned, and why
};
struct LookUpAnswered {
  base::Digest key;
  std::optional<Result> result;
  bool recorded = false;  // the store has the result on record; else it was found as a file only
};
struct WorkerConnected {
  ConnectionId connection = 0;
  std::string worker;
  std::vector<tasks::Kind> kinds;
  std::int32_t slots = 1;
  std::vector<AttemptId> holding;
};
struct WorkerDisconnected {
  ConnectionId connection = 0;
};
struct WorkerLeaving {
  ConnectionId connection = 0;
};
struct Progress {
  AttemptId id;
  double fraction = 0;
};
struct Heartbeat {
  ConnectionId connection = 0;
  std::vector<Progress> progress;
};
struct Succeeded {
  Result result;
};
struct AttemptFailed {
  Cause cause = Cause::kInternal;
  std::string message;
  // As far as they were measured.
  double seconds = 0;
  double cpu_seconds = 0;
  std::int64_t memory_peak = 0;  // bytes
};
struct Finished {
  ConnectionId connection = 0;
  AttemptId id;
  std::variant<Succeeded, AttemptFailed> outcome;
  std::string log;  // the end of what the attempt printed
};
struct Tick {};
struct CancelJob {
  std::string job;
};
/// Tries failed and cancelled tasks again. A job that is over also looks for each of its results again, and reads it: files get lost and damaged.
struct RetryJob {
  std::string job;
  std::int64_t memory_limit = 0;  // of its attempts from now on, as in JobTerms; 0: as it was
  double time_factor = 0;         // likewise
};
/// Nothing further of it is started, or it goes on. Not for a job that is over.
struct PauseJob {
  std::string job;
  bool paused = true;
};
/// Frees what a job that is over takes in memory. For others nothing happens.
struct JobForgotten {
  std::string job;
};

using Event = std::variant<Restored, JobSubmitted, TasksAdded, LookUpAnswered, WorkerConnected, WorkerDisconnected, WorkerLeaving, Heartbeat,
                           Finished, Tick, CancelJob, RetryJob, PauseJob, JobForgotten>;

}  // namespace vorocast::core
