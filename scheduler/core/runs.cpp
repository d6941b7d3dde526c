// SPDX-License-Identifier: AGPL-3.0-or-later
#include <algorithm>

#include <fmt/format.h>

#include "scheduler/core/transition.h"
#include "services/base/check.h"

namespace vorocast::core {

TaskIndex Transition::First(const Run& run) const {
  const auto urgency = [this](TaskIndex task) {
    const JobIndex job = state_.tasks[task].job;
    return std::tuple(-state_.jobs[job].priority, job, task);
  };
  VOROCAST_CHECK(!run.tasks.empty());
  return *std::min_element(run.tasks.begin(), run.tasks.end(), [&](TaskIndex a, TaskIndex b) { return urgency(a) < urgency(b); });
}

void Transition::Join(RunIndex run_index, TaskIndex task) {
  Unlist(run_index);
  state_.runs[run_index].tasks.push_back(task);
  state_.runs[run_index].kind = state_.tasks[task].kind;
  List(run_index);
  SetTask(task, Wanted{run_index});
}

void Transition::SetRun(RunIndex index, RunState next) {
  for (const TaskIndex task : state_.runs[index].tasks) Count(task, -1);
  Unlist(index);
  state_.runs[index].state = std::move(next);
  List(index);
  for (const TaskIndex task : state_.runs[index].tasks) Count(task, +1);
}

void Transition::EndRun(RunIndex index, const std::function<TaskState(const Task&)>& outcome) {
  for (const TaskIndex task : state_.runs[index].tasks) Count(task, -1);
  Unlist(index);
  Run run = std::move(state_.runs[index]);
  if (run.saved) effects_.records.push_back(RunEnded{run.key});
  state_.run_by_key.erase(run.key);
  state_.runs[index] = Run{};
  state_.free_runs.push_back(index);
  for (const TaskIndex task : run.tasks) {
    state_.tasks[task].state = outcome(state_.tasks[task]);
    Count(task, +1);
    ended_.push_back(task);
  }
}

void Transition::RevokeOthers(RunIndex index, std::int64_t ended) {
  const auto* leased = std::get_if<Leased>(&state_.runs[index].state);
  if (!leased) return;
  for (const Attempt& attempt : leased->attempts) {
    if (attempt.number == ended) continue;
    RecordAttempt(attempt, state_.runs[index], {.outcome = AttemptEnded::Outcome::kCancelled});
    const Worker& worker = state_.workers[attempt.worker];
    if (worker.connection != 0) Send(worker.connection, Revoke{{{state_.runs[index].key, attempt.number}}});
  }
}

void Transition::Abandon(RunIndex index) {
  RevokeOthers(index, 0);
  EndRun(index, [](const Task& task) { return task.state; });
}

void Transition::Save(const Run& run) {
  RunSaved saved{.key = run.key, .tries = run.tries};
  if (const auto* leased = std::get_if<Leased>(&run.state)) {
    const Attempt& first = leased->attempts.front();
    const Attempt& last = leased->attempts.back();
    saved.attempt = first.number;
    saved.worker = state_.workers[first.worker].name;
    if (&first != &last) {
      saved.copy_attempt = last.number;
      saved.copy_worker = state_.workers[last.worker].name;
    }
  }
  effects_.records.push_back(std::move(saved));
}

void Transition::RecordAttempt(const Attempt& attempt, const Task& task, AttemptEnded ended) {
  ended.job = state_.jobs[task.job].id;
  ended.task = task.name;
  ended.kind = task.kind;
  ended.attempt = attempt.number;
  ended.worker = state_.workers[attempt.worker].name;
  // One that began under an earlier scheduler is older than this one knows.
  ended.lasted = std::max(ended.lasted, now_ - attempt.started);
  effects_.records.emplace_back(std::move(ended));
}

void Transition::RecordAttempt(const Attempt& attempt, const Run& run, const AttemptEnded& ended) {
  for (const TaskIndex task : run.tasks) RecordAttempt(attempt, state_.tasks[task], ended);
}

void Transition::DropAttempt(RunIndex index, std::int64_t number) {
  Run& run = state_.runs[index];
  Unlist(index);
  std::erase_if(std::get<Leased>(run.state).attempts, [number](const Attempt& attempt) { return attempt.number == number; });
  List(index);
  Save(run);
  for (const TaskIndex task : run.tasks) Changed(state_.tasks[task].job);
}

void Transition::EndAttempt(const Held& held, Cause cause, const std::string& message, const AttemptEnded& told) {
  const RunIndex index = held.run;
  Run& run = state_.runs[index];
  const Attempt attempt = *held.attempt;
  AttemptEnded ended = told;
  ended.outcome = AttemptEnded::Outcome::kFailed;
  ended.cause = cause;
  ended.message = message;
  RecordAttempt(attempt, run, ended);
  if (CouldBeTheWorkers(cause)) NoteFailure(run, attempt.worker);
  const Verdict verdict = Judge(cause, {.memory = attempt.memory_raised, .time = attempt.time_raised}, run.tries);
  const bool goes_on = std::get<Leased>(run.state).attempts.size() > 1;
  // The other attempt may still make it, unless the input is at fault.
  if (goes_on && (verdict.again || cause != Cause::kInput)) return DropAttempt(index, attempt.number);
  if (run.tasks.empty()) return Abandon(index);
  if (verdict.again) {
    SetRun(index, verdict.rest > absl::ZeroDuration() ? RunState(Resting{now_ + verdict.rest, fmt::format("{}: {}", Name(cause), message)})
                                                      : RunState(Ready{}));
    return Save(run);
  }
  RevokeOthers(index, attempt.number);
  for (const TaskIndex task : run.tasks) {
    effects_.records.push_back(TaskFailed{state_.jobs[state_.tasks[task].job].id, state_.tasks[task].name, cause, message});
  }
  EndRun(index, [&](const Task&) { return Failed{cause, message}; });
}

Transition::Held Transition::FindAttempt(const AttemptId& id) {
  const auto found = state_.run_by_key.find(id.key);
  if (found == state_.run_by_key.end()) return {};
  auto* leased = std::get_if<Leased>(&state_.runs[found->second].state);
  if (!leased) return {};
  for (Attempt& attempt : leased->attempts) {
    if (attempt.number == id.attempt) return {found->second, &attempt};
  }
  return {};
}

Transition::Held Transition::AttemptOf(RunIndex run, WorkerIndex worker) {
  for (Attempt& attempt : std::get<Leased>(state_.runs[run].state).attempts) {
    if (attempt.worker == worker) return {run, &attempt};
  }
  VOROCAST_CHECK(false && "a worker holds a run that does not know it");
}

void Transition::On(LookUpAnswered& event) {
  const auto found = state_.run_by_key.find(event.key);
  if (found == state_.run_by_key.end()) return;
  const RunIndex index = found->second;
  if (!std::holds_alternative<LookingUp>(state_.runs[index].state)) return;
  if (event.result) {
    if (!event.recorded) effects_.records.push_back(ResultMade{event.key, *event.result});
    return EndRun(index, [&](const Task& task) { return Done{event.key, *event.result, event.result->made_for != state_.jobs[task.job].id}; });
  }
  std::vector<TaskIndex> leaving;
  for (const TaskIndex task : state_.runs[index].tasks) {
    if (state_.jobs[state_.tasks[task].job].starts_nothing()) leaving.push_back(task);
  }
  const bool wanted = leaving.size() < state_.runs[index].tasks.size();
  for (const TaskIndex task : leaving) Leave(task, Cancelled{});
  if (wanted) SetRun(index, Ready{});
}

void Transition::On(Finished& event) {
  // Whatever it is, the worker need not tell it again.
  Send(event.connection, Acknowledge{{event.id}});
  if (const WorkerIndex worker = WorkerOf(event.connection); worker != kNone) Hear(worker);
  const Held held = FindAttempt(event.id);
  if (held.run == kNone) return;
  AttemptEnded ended{.log = std::move(event.log)};
  if (const auto* failed = std::get_if<AttemptFailed>(&event.outcome)) {
    ended.lasted = absl::Seconds(failed->seconds);
    ended.cpu_seconds = failed->cpu_seconds;
    ended.memory_peak = failed->memory_peak;
    return EndAttempt(held, failed->cause, failed->message, ended);
  }
  const RunIndex index = held.run;
  Result& result = std::get<Succeeded>(event.outcome).result;
  const Run& run = state_.runs[index];
  ended.lasted = absl::Seconds(result.seconds);
  ended.cpu_seconds = result.cpu_seconds;
  ended.memory_peak = result.memory_peak;
  RecordAttempt(*held.attempt, run, ended);
  NoteSuccess(run, held.attempt->worker);
  if (!run.tasks.empty()) {
    Job& job = state_.jobs[state_.tasks[First(run)].job];
    result.made_for = job.id;
    job.recent[static_cast<std::size_t>(run.kind)].Add(result.seconds);
  }
  RevokeOthers(index, event.id.attempt);
  effects_.records.push_back(ResultMade{event.id.key, result});
  EndRun(index, [&](const Task& task) { return Done{event.id.key, result, result.made_for != state_.jobs[task.job].id}; });
}

}  // namespace vorocast::core
