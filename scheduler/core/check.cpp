// SPDX-License-Identifier: AGPL-3.0-or-later
#include "scheduler/core/check.h"

#include <algorithm>
#include <cmath>
#include <set>

#include <fmt/format.h>

namespace vorocast::core {
namespace {

#define REQUIRE_THAT(condition, ...) \
  if (!(condition)) return absl::InternalError(fmt::format("{}: {}", fmt::format(__VA_ARGS__), #condition))

absl::Status CheckTask(const State& state, TaskIndex index, bool keys) {
  const Task& task = state.tasks[index];
  std::uint32_t unmet = 0;
  for (const TaskInput& input : task.inputs) {
    if (input.task == kNone) continue;
    REQUIRE_THAT(input.task < index, "{}", task.name);
    REQUIRE_THAT(state.tasks[input.task].job == task.job, "{}", task.name);
    if (!HasEnded(state.tasks[input.task])) ++unmet;
  }
  if (const auto* blocked = std::get_if<Blocked>(&task.state)) {
    REQUIRE_THAT(blocked->unmet == unmet, "{}: {} against {}", task.name, blocked->unmet, unmet);
    REQUIRE_THAT(unmet > 0, "{} is blocked by nothing", task.name);
  }
  const auto* wanted = std::get_if<Wanted>(&task.state);
  const auto* done = std::get_if<Done>(&task.state);
  if (!wanted && !done) return absl::OkStatus();
  REQUIRE_THAT(unmet == 0, "{}: inputs before outputs", task.name);
  for (const TaskInput& input : task.inputs) {
    if (input.task == kNone) continue;
    const TaskState& maker = state.tasks[input.task].state;
    REQUIRE_THAT(std::holds_alternative<Done>(maker) || (input.optional && std::holds_alternative<Failed>(maker)), "{}", task.name);
  }
  if (keys) REQUIRE_THAT(SpecOf(state, task).Key() == (done ? done->key : state.runs[wanted->run].key), "{}", task.name);
  if (done) return absl::OkStatus();
  const Run& run = state.runs[wanted->run];
  REQUIRE_THAT(std::count(run.tasks.begin(), run.tasks.end(), index) == 1, "{}", task.name);
  return absl::OkStatus();
}

/// What the accounts should say.
struct Recount {
  std::map<std::string, std::int32_t> leased_by_user;
  std::map<JobIndex, std::int32_t> at_work;
  std::size_t leases = 0;
};

absl::Status CheckLeased(const State& state, RunIndex index, const Leased& leased, std::set<std::int64_t>& numbers, Recount& recount) {
  const Run& run = state.runs[index];
  REQUIRE_THAT(run.saved, "run {}", index);
  REQUIRE_THAT(leased.attempts.size() == 1 || leased.attempts.size() == 2, "run {} has {} attempts", index, leased.attempts.size());
  REQUIRE_THAT(leased.attempts.front().worker != leased.attempts.back().worker || leased.attempts.size() == 1, "run {} twice on a worker", index);
  for (const Attempt& attempt : leased.attempts) {
    ++recount.leases;
    REQUIRE_THAT(numbers.insert(attempt.number).second, "attempt {} twice", attempt.number);
    REQUIRE_THAT(attempt.number < state.attempt_next && state.attempt_next <= state.attempt_reserved, "attempt {}", attempt.number);
    REQUIRE_THAT(state.deadlines.contains({attempt.deadline, index, attempt.number}), "run {}", index);
    REQUIRE_THAT(state.workers[attempt.worker].runs.contains(index), "run {}", index);
    if (attempt.job == kNone) continue;
    const auto is_its = [&](TaskIndex task) { return state.tasks[task].job == attempt.job; };
    REQUIRE_THAT(std::any_of(run.tasks.begin(), run.tasks.end(), is_its), "run {} is on the account of a job that does not want it", index);
    ++recount.leased_by_user[state.jobs[attempt.job].user];
    ++recount.at_work[attempt.job];
  }
  return absl::OkStatus();
}

absl::Status CheckRuns(const State& state) {
  std::set<std::tuple<JobIndex, TaskIndex, RunIndex>> ready;
  std::size_t timed = 0;
  Recount recount;
  std::set<std::int64_t> numbers;
  for (const auto& [key, index] : state.run_by_key) {
    const Run& run = state.runs[index];
    REQUIRE_THAT(run.key == key, "run {}", index);
    REQUIRE_THAT(!run.tasks.empty() || std::holds_alternative<Leased>(run.state), "run {} without tasks", index);
    for (const TaskIndex task : run.tasks) {
      const auto* wanted = std::get_if<Wanted>(&state.tasks[task].state);
      REQUIRE_THAT(wanted && wanted->run == index, "run {}", index);
      if (std::holds_alternative<Ready>(run.state)) ready.insert({state.tasks[task].job, task, index});
    }
    if (const auto* resting = std::get_if<Resting>(&run.state)) {
      ++timed;
      REQUIRE_THAT(state.deadlines.contains({resting->until, index, 0}), "run {}", index);
    }
    const auto* leased = std::get_if<Leased>(&run.state);
    if (leased) RETURN_IF_ERROR(CheckLeased(state, index, *leased, numbers, recount));
  }
  REQUIRE_THAT(state.run_by_key.size() + state.free_runs.size() == state.runs.size(), "runs");
  REQUIRE_THAT(timed + recount.leases == state.deadlines.size(), "deadlines");
  REQUIRE_THAT(recount.leased_by_user == state.leased_by_user, "leases by user");
  std::size_t queued = 0;
  std::size_t listed = 0;
  for (JobIndex index = 0; index < state.jobs.size(); ++index) {
    const Job& job = state.jobs[index];
    REQUIRE_THAT(job.at_work == recount.at_work[index], "{} has {} at work", job.id, job.at_work);
    REQUIRE_THAT(job.terms.workers_max == 0 || job.at_work <= job.terms.workers_max, "{} has {} at work", job.id, job.at_work);
    std::uint32_t kinds = 0;
    for (std::size_t kind = 0; kind < kKinds; ++kind) {
      queued += job.ready[kind].size();
      for (const auto& [task, run] : job.ready[kind]) {
        REQUIRE_THAT(ready.contains({index, task, run}) && static_cast<std::size_t>(state.tasks[task].kind) == kind, "{} run {}", job.id, run);
      }
      const bool may_go = !job.ready[kind].empty() && !job.paused && !job.starts_nothing() && job.has_room();
      if (!may_go) continue;
      ++listed;
      kinds |= 1u << kind;
      REQUIRE_THAT(state.groups.at({job.priority, job.user}).jobs[kind].contains(PlaceOf(job, index)), "{} kind {}", job.id, kind);
    }
    REQUIRE_THAT(kinds == job.listed, "{}", job.id);
  }
  REQUIRE_THAT(queued == ready.size(), "{} queued, {} ready", queued, ready.size());
  for (const auto& [key, group] : state.groups) {
    std::size_t places = 0;
    for (const auto& jobs : group.jobs) places += jobs.size();
    REQUIRE_THAT(places > 0, "an empty group of {}", key.user);
    listed -= places;
  }
  REQUIRE_THAT(listed == 0, "jobs in groups");
  return absl::OkStatus();
}

absl::Status CheckSetAside(const State& state) {
  std::uint32_t kinds = 0;
  std::size_t set_aside = 0;
  for (const Worker& worker : state.workers) {
    if (worker.is_there() && !worker.health.set_aside) kinds |= worker.kinds;
  }
  for (WorkerIndex index = 0; index < state.workers.size(); ++index) {
    const Worker& worker = state.workers[index];
    if (!worker.health.set_aside) continue;
    ++set_aside;
    REQUIRE_THAT(state.set_aside.contains({worker.health.until, index}), "worker {}", worker.name);
    REQUIRE_THAT(worker.connection == 0 || (worker.kinds & ~kinds) == 0, "worker {} is set aside and nobody is left for its work", worker.name);
  }
  REQUIRE_THAT(set_aside == state.set_aside.size(), "set aside");
  return absl::OkStatus();
}

absl::Status CheckWorkers(const State& state) {
  std::size_t idle = 0;
  std::size_t held = 0;
  for (WorkerIndex index = 0; index < state.workers.size(); ++index) {
    const Worker& worker = state.workers[index];
    held += worker.runs.size();
    for (const RunIndex run : worker.runs) {
      const auto* leased = std::get_if<Leased>(&state.runs[run].state);
      const auto is_its = [index](const Attempt& attempt) { return attempt.worker == index; };
      REQUIRE_THAT(leased && std::count_if(leased->attempts.begin(), leased->attempts.end(), is_its) == 1, "worker {}", worker.name);
    }
    if (worker.free() > 0) {
      ++idle;
      REQUIRE_THAT(state.idle.at(worker.kinds).contains({-worker.free(), index}), "worker {}", worker.name);
      for (const auto& [key, group] : state.groups) {
        for (std::size_t kind = 0; kind < kKinds; ++kind) {
          REQUIRE_THAT(!(worker.kinds & (1u << kind)) || group.jobs[kind].empty(), "worker {} is idle while work waits", worker.name);
        }
      }
    }
    if (worker.connection != 0) REQUIRE_THAT(state.worker_by_connection.at(worker.connection) == index, "worker {}", worker.name);
    if (!worker.name.empty()) REQUIRE_THAT(state.worker_by_name.at(worker.name) == index, "worker {}", worker.name);
  }
  std::size_t listed = 0;
  for (const auto& [kinds, workers] : state.idle) listed += workers.size();
  REQUIRE_THAT(listed == idle, "idle workers");
  std::size_t leases = 0;
  for (const auto& [key, run] : state.run_by_key) {
    if (const auto* leased = std::get_if<Leased>(&state.runs[run].state)) leases += leased->attempts.size();
  }
  REQUIRE_THAT(held == leases, "leases");
  return absl::OkStatus();
}

absl::Status CheckJob(const State& state, const Job& job) {
  std::array<KindCounts, kKinds> counts;
  std::size_t running = 0;
  std::set<TaskIndex> failed;
  std::int32_t bad_frames = 0;
  for (const TaskIndex index : job.tasks) {
    const Task& task = state.tasks[index];
    KindCounts& of_kind = counts[static_cast<std::size_t>(task.kind)];
    const Phase phase = PhaseOf(state, task);
    ++of_kind.phase[static_cast<std::size_t>(phase)];
    running += phase == Phase::kRunning;
    if (phase == Phase::kRunning) REQUIRE_THAT(job.running.contains(index), "{}", task.name);
    if (const auto* done = std::get_if<Done>(&task.state)) {
      of_kind.reused += done->reused;
      of_kind.measured += !done->reused;
      of_kind.seconds += done->reused ? 0 : done->result.seconds;
    }
    if (const auto* own = std::get_if<Failed>(&task.state); own && own->cause != Cause::kNeeds) {
      failed.insert(index);
      bad_frames += task.kind == tasks::Kind::kTessellate;
    }
    if (job.starts_nothing()) {
      const auto* wanted = std::get_if<Wanted>(&task.state);
      REQUIRE_THAT(!wanted || std::holds_alternative<LookingUp>(state.runs[wanted->run].state), "{} goes on in a stopped job", task.name);
    }
  }
  for (std::size_t kind = 0; kind < kKinds; ++kind) {
    REQUIRE_THAT(counts[kind].phase == job.counts[kind].phase, "{} counters of kind {}", job.id, kind);
    REQUIRE_THAT(counts[kind].reused == job.counts[kind].reused && counts[kind].measured == job.counts[kind].measured, "{} kind {}", job.id, kind);
    REQUIRE_THAT(std::abs(counts[kind].seconds - job.counts[kind].seconds) < 1e-6, "{} kind {}", job.id, kind);
  }
  REQUIRE_THAT(running == job.running.size(), "{}", job.id);
  REQUIRE_THAT(failed == job.failed, "{}", job.id);
  REQUIRE_THAT(bad_frames == job.bad_frames, "{}", job.id);
  REQUIRE_THAT(job.starts_nothing() || !job.has_too_many_bad_frames(), "{}", job.id);
  return absl::OkStatus();
}

#undef REQUIRE_THAT

}  // namespace

absl::Status Check(const State& state, bool keys) {
  for (TaskIndex index = 0; index < state.tasks.size(); ++index) {
    if (state.tasks.HasBlock(index) && state.tasks[index].job != kNone) RETURN_IF_ERROR(CheckTask(state, index, keys));
  }
  RETURN_IF_ERROR(CheckRuns(state));
  RETURN_IF_ERROR(CheckWorkers(state));
  RETURN_IF_ERROR(CheckSetAside(state));
  for (const Job& job : state.jobs) RETURN_IF_ERROR(CheckJob(state, job));
  return absl::OkStatus();
}

}  // namespace vorocast::core
