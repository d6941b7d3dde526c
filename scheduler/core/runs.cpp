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

void Transition::List(RunIndex index) {
  const Run& run = state_.runs[index];
  if (std::holds_alternative<Ready>(run.state) && !run.tasks.empty()) {
    const TaskIndex first = First(run);
    const Job& job = state_.jobs[state_.tasks[first].job];
    state_.groups[{job.priority, job.user}].ready[static_cast<std::size_t>(run.kind)].insert({state_.tasks[first].job, first, index});
  } else if (const auto* resting = std::get_if<Resting>(&run.state)) {
    state_.deadlines.insert({resting->until, index});
  } else if (const auto* leased = std::get_if<Leased>(&run.state)) {
    state_.deadlines.insert({leased->deadline, index});
    if (!run.tasks.empty()) ++state_.leased_by_user[state_.jobs[state_.tasks[First(run)].job].user];
    Delist(leased->worker);
    state_.workers[leased->worker].runs.insert(index);
    Enlist(leased->worker);
  }
}

void Transition::Unlist(RunIndex index) {
  const Run& run = state_.runs[index];
  if (std::holds_alternative<Ready>(run.state) && !run.tasks.empty()) {
    const TaskIndex first = First(run);
    const Job& job = state_.jobs[state_.tasks[first].job];
    const auto group = state_.groups.find({job.priority, job.user});
    VOROCAST_CHECK(group != state_.groups.end());
    auto& ready = group->second.ready;
    VOROCAST_CHECK(ready[static_cast<std::size_t>(run.kind)].erase({state_.tasks[first].job, first, index}) == 1);
    if (std::all_of(ready.begin(), ready.end(), [](const auto& places) { return places.empty(); })) state_.groups.erase(group);
  } else if (const auto* resting = std::get_if<Resting>(&run.state)) {
    state_.deadlines.erase({resting->until, index});
  } else if (const auto* leased = std::get_if<Leased>(&run.state)) {
    state_.deadlines.erase({leased->deadline, index});
    if (!run.tasks.empty()) {
      const auto user = state_.leased_by_user.find(state_.jobs[state_.tasks[First(run)].job].user);
      if (--user->second == 0) state_.leased_by_user.erase(user);
    }
    Delist(leased->worker);
    state_.workers[leased->worker].runs.erase(index);
    Enlist(leased->worker);
    absent_.push_back(leased->worker);
  }
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

void Transition::Abandon(RunIndex index) {
  if (const auto* leased = std::get_if<Leased>(&state_.runs[index].state)) {
    const Worker& worker = state_.workers[leased->worker];
    if (worker.connection != 0) Send(worker.connection, Revoke{{{state_.runs[index].key, leased->attempt}}});
  }
  EndRun(index, [](const Task& task) { return task.state; });
}

void Transition::Save(const Run& run) {
  RunSaved saved{.key = run.key, .tries = run.tries};
  if (const auto* leased = std::get_if<Leased>(&run.state)) {
    saved.attempt = leased->attempt;
    saved.worker = state_.workers[leased->worker].name;
  }
  effects_.records.push_back(std::move(saved));
}

void Transition::RecordAttempt(const Run& run, const Task& task, AttemptEnded ended) {
  const auto& leased = std::get<Leased>(run.state);
  ended.job = state_.jobs[task.job].id;
  ended.task = task.name;
  ended.kind = task.kind;
  ended.attempt = leased.attempt;
  ended.worker = state_.workers[leased.worker].name;
  // One that began under an earlier scheduler is older than this one knows.
  ended.lasted = std::max(ended.lasted, now_ - leased.started);
  effects_.records.emplace_back(std::move(ended));
}

void Transition::EndAttempt(RunIndex index, Cause cause, const std::string& message, const AttemptEnded& told) {
  Run& run = state_.runs[index];
  AttemptEnded ended = told;
  ended.outcome = AttemptEnded::Outcome::kFailed;
  ended.cause = cause;
  ended.message = message;
  for (const TaskIndex task : run.tasks) RecordAttempt(run, state_.tasks[task], ended);
  const Verdict verdict = Judge(cause, run.tries);
  if (run.tasks.empty()) return Abandon(index);
  if (verdict.again) {
    SetRun(index, verdict.rest > absl::ZeroDuration() ? RunState(Resting{now_ + verdict.rest, fmt::format("{}: {}", Name(cause), message)})
                                                      : RunState(Ready{}));
    return Save(run);
  }
  for (const TaskIndex task : run.tasks) {
    effects_.records.push_back(TaskFailed{state_.jobs[state_.tasks[task].job].id, state_.tasks[task].name, cause, message});
  }
  EndRun(index, [&](const Task&) { return Failed{cause, message}; });
}

RunIndex Transition::FindAttempt(const AttemptId& id) const {
  const auto found = state_.run_by_key.find(id.key);
  if (found == state_.run_by_key.end()) return kNone;
  const auto* leased = std::get_if<Leased>(&state_.runs[found->second].state);
  return leased && leased->attempt == id.attempt ? found->second : kNone;
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
  const RunIndex index = FindAttempt(event.id);
  if (index == kNone) return;
  AttemptEnded ended{.log = std::move(event.log)};
  if (const auto* failed = std::get_if<AttemptFailed>(&event.outcome)) {
    ended.lasted = absl::Seconds(failed->seconds);
    ended.cpu_seconds = failed->cpu_seconds;
    ended.memory_peak = failed->memory_peak;
    return EndAttempt(index, failed->cause, failed->message, ended);
  }
  Result& result = std::get<Succeeded>(event.outcome).result;
  const Run& run = state_.runs[index];
  ended.lasted = absl::Seconds(result.seconds);
  ended.cpu_seconds = result.cpu_seconds;
  ended.memory_peak = result.memory_peak;
  for (const TaskIndex task : run.tasks) RecordAttempt(run, state_.tasks[task], ended);
  if (!run.tasks.empty()) result.made_for = state_.jobs[state_.tasks[First(run)].job].id;
  effects_.records.push_back(ResultMade{event.id.key, result});
  EndRun(index, [&](const Task& task) { return Done{event.id.key, result, result.made_for != state_.jobs[task.job].id}; });
}

}  // namespace vorocast::core
