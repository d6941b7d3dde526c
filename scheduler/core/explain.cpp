// SPDX-License-Identifier: AGPL-3.0-or-later
#include <fmt/format.h>

#include "scheduler/core/job_view.h"

namespace vorocast::core {
namespace {

bool AnyWorkerFor(const State& state, tasks::Kind kind, bool with_free_slot) {
  for (const Worker& worker : state.workers) {
    const bool can = worker.connection != 0 && (worker.kinds & (1u << static_cast<unsigned>(kind)));
    if (can && (!with_free_slot || worker.free() > 0)) return true;
  }
  return false;
}

std::string ExplainRun(const State& state, const Job& job, const Task& task, const Run& run) {
  const std::string attempts = run.tries.failed > 0 ? fmt::format(" ({} of {} attempts failed so far)", run.tries.failed, kFailedMax) : "";
  if (std::holds_alternative<LookingUp>(run.state))
    return fmt::format("{} is about to start: the store is being asked whether its result exists.", task.name);
  if (const auto* resting = std::get_if<Resting>(&run.state))
    return fmt::format("{} waits a moment before its next attempt{}; the last one ended with {}", task.name, attempts, resting->why);
  if (const auto* leased = std::get_if<Leased>(&run.state)) {
    const Attempt& first = leased->attempts.front();
    const Worker& worker = state.workers[first.worker];
    const std::string away = worker.connection == 0 ? ", which is away and may come back" : "";
    std::string copy;
    if (leased->attempts.size() > 1) {
      const Attempt& second = leased->attempts.back();
      copy = fmt::format(", and as it takes long also on worker {}, {:.0f} %", state.workers[second.worker].name, 100 * second.fraction);
    }
    return fmt::format("{} runs on worker {}{}, {:.0f} % done{}{}.", task.name, worker.name, away, 100 * first.fraction, copy, attempts);
  }
  if (job.paused) return fmt::format("{} waits: {} is paused; 'vorocast resume {}' lets it go on.", task.name, job.id, job.id);
  if (!job.has_room()) {
    return fmt::format("{} waits its turn{}: {} may have {} workers at once, and has them.", task.name, attempts, job.id, job.terms.workers_max);
  }
  if (!AnyWorkerFor(state, task.kind, false))
    return fmt::format("{} waits for a worker that can {}: none is connected.", task.name, tasks::Name(task.kind));
  if (!AnyWorkerFor(state, task.kind, true))
    return fmt::format("{} waits its turn{}: every worker that can {} is busy.", task.name, attempts, tasks::Name(task.kind));
  return fmt::format("{} is ready and about to be handed to a worker{}; the job's priority is {}.", task.name, attempts, job.priority);
}

std::string ExplainBlocked(const State& state, const Task& task, std::uint32_t unmet) {
  for (const TaskInput& input : task.inputs) {
    if (input.task == kNone || HasEnded(state.tasks[input.task])) continue;
    const std::string& first = state.tasks[input.task].name;
    if (unmet == 1) return fmt::format("{} waits for \"{}\".", task.name, first);
    return fmt::format("{} waits for {} tasks, \"{}\" first.", task.name, unmet, first);
  }
  return fmt::format("{} waits for its inputs.", task.name);
}

std::string ExplainTask(const State& state, const Job& job, const Task& task) {
  if (const auto* blocked = std::get_if<Blocked>(&task.state)) return ExplainBlocked(state, task, blocked->unmet);
  if (const auto* wanted = std::get_if<Wanted>(&task.state)) return ExplainRun(state, job, task, state.runs[wanted->run]);
  if (const auto* done = std::get_if<Done>(&task.state)) {
    if (done->reused) return fmt::format("{} is done: its result existed already.", task.name);
    return fmt::format("{} is done; it took {:.1f} s.", task.name, done->result.seconds);
  }
  if (const auto* failed = std::get_if<Failed>(&task.state))
    return fmt::format("{} failed: {}: {}.", task.name, Name(failed->cause), failed->message);
  if (job.cancelled) return fmt::format("{} was cancelled with its job.", task.name);
  return fmt::format("{} was not started: {}.", task.name, job.stopped.value_or("what it reads was cancelled"));
}

/// A bad frame is made up for and a task that lacked an input failed for another's sake: neither is why the job failed, if anything else is.
const Task& FailureThatCounts(const State& state, const Job& job) {
  for (const TaskIndex index : job.failed) {
    const Task& task = state.tasks[index];
    if (task.kind != tasks::Kind::kTessellate && std::get<Failed>(task.state).cause != Cause::kNeeds) return task;
  }
  return state.tasks[*job.failed.begin()];
}

}  // namespace

std::string Explain(const State& state, const Job& job) {
  if (job.cancelled) return fmt::format("{} was cancelled; finished results stay, and a retry goes on from them.", job.id);
  if (job.stopped) return fmt::format("{} failed: {}.", job.id, *job.stopped);
  const Phase phase = PhaseOf(job);
  if (phase == Phase::kDone && job.bad_frames > 0) return fmt::format("{} is done; {} bad frames were made up for.", job.id, job.bad_frames);
  if (phase == Phase::kDone) return fmt::format("{} is done.", job.id);
  if (phase == Phase::kFailed) return fmt::format("{} failed: {}", job.id, ExplainTask(state, job, FailureThatCounts(state, job)));
  if (job.paused) {
    return fmt::format("{} is paused: {} of its tasks still run to their end, and nothing further is started; 'vorocast resume {}' lets it go on.",
                       job.id, job.running.size(), job.id);
  }
  if (!job.running.empty()) {
    return fmt::format("{} runs: {} tasks at work, the first of them {}", job.id, job.running.size(),
                       ExplainTask(state, job, state.tasks[*job.running.begin()]));
  }
  for (const TaskIndex index : job.tasks) {
    if (std::holds_alternative<Wanted>(state.tasks[index].state))
      return fmt::format("{} waits: {}", job.id, ExplainTask(state, job, state.tasks[index]));
  }
  if (!job.complete) return fmt::format("{} waits for frames: its take is still open.", job.id);
  return fmt::format("{} waits.", job.id);
}

absl::StatusOr<std::string> Explain(const State& state, const Job& job, const std::string& task) {
  const std::string prefix = job.id + "/";
  const auto found = job.by_name.find(task.starts_with(prefix) ? task.substr(prefix.size()) : task);
  if (found == job.by_name.end()) {
    return absl::NotFoundError(fmt::format("{} has no task \"{}\"; a task is named like \"frame 412: tessellate\" or \"assemble\"", job.id, task));
  }
  return ExplainTask(state, job, state.tasks[found->second]);
}

}  // namespace vorocast::core
