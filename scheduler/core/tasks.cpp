// SPDX-License-Identifier: AGPL-3.0-or-later
#include <algorithm>

#include <fmt/format.h>

#include "scheduler/core/transition.h"
#include "services/base/check.h"

namespace vorocast::core {

TaskIndex Transition::AddTask(JobIndex job_index, plan::PlannedTask& planned) {
  const auto index = static_cast<TaskIndex>(state_.tasks.size());
  Job& job = state_.jobs[job_index];
  Task task{.job = job_index, .kind = planned.kind, .name = planned.name, .output = std::move(planned.output)};
  // Neighbours in a plan mostly have the same options: one copy serves them all.
  const Task* last = job.tasks.empty() ? nullptr : &state_.tasks[job.tasks.back()];
  task.options = last && last->kind == task.kind && *last->options == planned.options
                     ? last->options
                     : std::make_shared<const nlohmann::json>(std::move(planned.options));
  Blocked blocked;
  task.inputs.reserve(planned.inputs.size());
  for (plan::PlannedInput& input : planned.inputs) {
    TaskInput& read = task.inputs.emplace_back();
    read.role = std::move(input.role);
    read.frame = input.frame;
    read.blob = input.blob;
    read.extension = std::move(input.extension);
    read.optional = input.optional;
    if (input.task.empty()) continue;
    const auto maker = job.by_name.find(input.task);
    VOROCAST_CHECK(maker != job.by_name.end());
    read.task = maker->second;
    state_.tasks[read.task].dependents.push_back(index);
    ++job.reads[static_cast<std::size_t>(task.kind)][static_cast<std::size_t>(state_.tasks[read.task].kind)];
    if (!HasEnded(state_.tasks[read.task])) ++blocked.unmet;
  }
  task.state = blocked;
  state_.tasks.push_back(std::move(task));
  job.tasks.push_back(index);
  job.by_name.emplace(std::move(planned.name), index);
  Count(index, +1);
  return index;
}

void Transition::Count(TaskIndex index, int sign) {
  const Task& task = state_.tasks[index];
  Job& job = state_.jobs[task.job];
  KindCounts& counts = job.counts[static_cast<std::size_t>(task.kind)];
  const Phase phase = PhaseOf(state_, task);
  counts.phase[static_cast<std::size_t>(phase)] += sign;
  if (phase == Phase::kRunning) sign > 0 ? (void)job.running.insert(index) : (void)job.running.erase(index);
  if (const auto* done = std::get_if<Done>(&task.state)) {
    if (done->reused) {
      counts.reused += sign;
    } else {
      counts.measured += sign;
      counts.seconds += sign * done->result.seconds;
    }
  }
  if (const auto* failed = std::get_if<Failed>(&task.state); failed && failed->cause != Cause::kNeeds) {
    sign > 0 ? (void)job.failed.insert(index) : (void)job.failed.erase(index);
    if (task.kind == tasks::Kind::kTessellate) job.bad_frames += sign;
    if (sign > 0 && job.has_too_many_bad_frames()) to_stop_.push_back(task.job);
  }
  Changed(task.job);
}

void Transition::SetTask(TaskIndex index, TaskState next) {
  Count(index, -1);
  state_.tasks[index].state = std::move(next);
  Count(index, +1);
  if (HasEnded(state_.tasks[index]) && !state_.tasks[index].dependents.empty()) ended_.push_back(index);
}

void Transition::Leave(TaskIndex index, TaskState next) {
  const auto* wanted = std::get_if<Wanted>(&state_.tasks[index].state);
  if (!wanted) return SetTask(index, std::move(next));
  const RunIndex run_index = wanted->run;
  const Run& run = state_.runs[run_index];
  if (const auto* leased = std::get_if<Leased>(&run.state)) {
    for (const Attempt& attempt : leased->attempts) {
      RecordAttempt(attempt, state_.tasks[index], {.outcome = AttemptEnded::Outcome::kCancelled});
    }
  }
  SetTask(index, std::move(next));
  Unlist(run_index);
  std::erase(state_.runs[run_index].tasks, index);
  List(run_index);
  if (state_.runs[run_index].tasks.empty()) Abandon(run_index);
}

void Transition::Resolve(TaskIndex index) {
  for (const TaskInput& input : state_.tasks[index].inputs) {
    if (input.task == kNone) continue;
    const Task& maker = state_.tasks[input.task];
    if (std::holds_alternative<Cancelled>(maker.state)) return SetTask(index, Cancelled{});
    if (!input.optional && std::holds_alternative<Failed>(maker.state)) {
      return SetTask(index, Failed{Cause::kNeeds, fmt::format("needs \"{}\", which failed", maker.name)});
    }
  }
  Want(index);
}

void Transition::Want(TaskIndex index) {
  Task& task = state_.tasks[index];
  const base::Digest key = SpecOf(state_, task).Key();
  const bool starts_nothing = state_.jobs[task.job].starts_nothing();
  if (const auto found = state_.run_by_key.find(key); found != state_.run_by_key.end()) {
    // What has been looked up already does not exist.
    if (starts_nothing && !std::holds_alternative<LookingUp>(state_.runs[found->second].state)) return SetTask(index, Cancelled{});
    return Join(found->second, index);
  }
  RunIndex run_index = static_cast<RunIndex>(state_.runs.size());
  if (state_.free_runs.empty()) {
    state_.runs.push_back({});
  } else {
    run_index = state_.free_runs.back();
    state_.free_runs.pop_back();
  }
  Run& run = state_.runs[run_index];
  run = Run{.key = key, .kind = task.kind};
  if (const auto before = state_.tries_before.find(key); before != state_.tries_before.end()) {
    run.tries = before->second;
    run.saved = true;
    state_.tries_before.erase(before);
  }
  state_.run_by_key.emplace(key, run_index);
  Join(run_index, index);
  effects_.look_ups.push_back({key, std::string(tasks::Extension(task.kind)), state_.jobs[task.job].verify});
}

void Transition::FlowEndings() {
  while (!ended_.empty()) {
    const TaskIndex ended = ended_.front();
    ended_.pop_front();
    // By position: telling a dependent may add to other tasks' lists, never to this one's.
    for (std::size_t i = 0; i < state_.tasks[ended].dependents.size(); ++i) {
      const TaskIndex dependent = state_.tasks[ended].dependents[i];
      auto* blocked = std::get_if<Blocked>(&state_.tasks[dependent].state);
      if (blocked && --blocked->unmet == 0) Resolve(dependent);
    }
  }
}

void Transition::StopJob(JobIndex index) {
  Job& job = state_.jobs[index];
  if (!job.starts_nothing()) {
    const auto is_frame = [this](TaskIndex task) { return state_.tasks[task].kind == tasks::Kind::kTessellate; };
    const Task& first = state_.tasks[*std::find_if(job.failed.begin(), job.failed.end(), is_frame)];
    job.stopped = fmt::format("{} frames failed, and the job makes up for {} at most; the first: {}: {}", job.bad_frames, job.bad_frames_max,
                              first.name, std::get<Failed>(first.state).message);
  }
  for (const TaskIndex task : job.tasks) {
    if (!HasEnded(state_.tasks[task])) Leave(task, Cancelled{});
  }
  Changed(index);
}

void Transition::ResetTasks(JobIndex job_index, bool all) {
  // Also results made without the failed ones: their inputs, and so their keys, may change.
  std::vector<TaskIndex> reset;
  std::set<TaskIndex> seen;
  for (const TaskIndex task : state_.jobs[job_index].tasks) {
    const TaskState& state = state_.tasks[task].state;
    if (all || std::holds_alternative<Failed>(state) || std::holds_alternative<Cancelled>(state)) {
      if (seen.insert(task).second) reset.push_back(task);
    }
  }
  for (std::size_t i = 0; i < reset.size(); ++i) {
    for (const TaskIndex dependent : state_.tasks[reset[i]].dependents) {
      if (seen.insert(dependent).second) reset.push_back(dependent);
    }
  }
  for (const TaskIndex task : seen) Leave(task, Blocked{});
  for (const TaskIndex task : seen) {
    Blocked blocked;
    for (const TaskInput& input : state_.tasks[task].inputs) {
      if (input.task != kNone && !HasEnded(state_.tasks[input.task])) ++blocked.unmet;
    }
    state_.tasks[task].state = blocked;
  }
  for (const TaskIndex task : seen) {
    const auto* blocked = std::get_if<Blocked>(&state_.tasks[task].state);
    if (blocked && blocked->unmet == 0) Resolve(task);
  }
}

}  // namespace vorocast::core
