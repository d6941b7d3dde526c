// SPDX-License-Identifier: AGPL-3.0-or-later
#include <algorithm>

#include "scheduler/core/transition.h"

namespace vorocast::core {
namespace {

/// How long after a restart a run that workers brought along waits for its task to be planned again.
constexpr absl::Duration kAdoption = absl::Minutes(1);

}  // namespace

void Transition::On(Restored& event) {
  state_.adoption_ends = now_ + kAdoption;
  state_.attempt_next = state_.attempt_reserved = event.attempt_next;
  for (const RunSaved& saved : event.runs) {
    if (saved.worker.empty()) {
      state_.tries_before.emplace(saved.key, saved.tries);
      continue;
    }
    const WorkerIndex worker = Known(saved.worker);
    const auto index = static_cast<RunIndex>(state_.runs.size());
    state_.runs.push_back({.key = saved.key, .tries = saved.tries, .saved = true});
    state_.run_by_key.emplace(saved.key, index);
    Leased leased;
    leased.attempts.push_back(Remembered(saved.attempt, worker));
    if (!saved.copy_worker.empty()) leased.attempts.push_back(Remembered(saved.copy_attempt, Known(saved.copy_worker)));
    SetRun(index, std::move(leased));
  }
}

Attempt Transition::Remembered(std::int64_t number, WorkerIndex worker) const {
  return {.number = number, .worker = worker, .deadline = now_ + state_.settings.lease, .started = now_};
}

void Transition::On(JobSubmitted& event) {
  const auto index = static_cast<JobIndex>(state_.jobs.size());
  if (!state_.job_by_id.emplace(event.id, index).second) return;
  Job& job = state_.jobs.emplace_back();
  job.id = std::move(event.id);
  job.name = std::move(event.name);
  job.user = std::move(event.user);
  job.priority = event.priority;
  job.terms = event.terms;
  job.paused = event.paused;
  job.cancelled = event.cancelled;
  job.verify = event.verify;
  for (TaskFailed& failure : event.failures) {
    std::string task = failure.task;
    job.failed_before.emplace(std::move(task), std::move(failure));
  }
  Changed(index);
}

void Transition::On(TasksAdded& event) {
  const auto found = state_.job_by_id.find(event.job);
  if (found == state_.job_by_id.end()) return;
  const JobIndex index = found->second;
  Job& job = state_.jobs[index];
  job.complete = job.complete || event.complete || event.impossible;
  if (event.bad_frames_max >= 0) job.bad_frames_max = event.bad_frames_max;
  if (event.impossible) job.stopped = job.impossible = event.impossible;
  for (plan::PlannedTask& planned : event.tasks) {
    if (job.by_name.contains(planned.name)) continue;
    const TaskIndex task = AddTask(index, planned);
    if (const auto before = job.failed_before.find(state_.tasks[task].name); before != job.failed_before.end()) {
      SetTask(task, Failed{before->second.cause, before->second.message});
    } else if (std::get<Blocked>(state_.tasks[task].state).unmet == 0) {
      Resolve(task);
    }
  }
  if (event.impossible || job.has_too_many_bad_frames()) to_stop_.push_back(index);
  Changed(index);
}

void Transition::On(CancelJob& event) {
  const auto found = state_.job_by_id.find(event.job);
  if (found == state_.job_by_id.end()) return;
  Job& job = state_.jobs[found->second];
  if (job.cancelled || IsOver(job)) return;
  job.cancelled = true;
  effects_.records.push_back(JobCancelled{job.id});
  StopJob(found->second);
}

void Transition::On(RetryJob& event) {
  const auto found = state_.job_by_id.find(event.job);
  if (found == state_.job_by_id.end()) return;
  Job& job = state_.jobs[found->second];
  const bool over = IsOver(job);
  job.verify = job.verify || over;
  job.cancelled = false;
  job.stopped = job.impossible;
  job.failed_before.clear();
  effects_.records.push_back(JobRetried{job.id});
  if (event.memory_limit > 0) job.terms.memory_limit = event.memory_limit;
  if (event.time_factor > 0) job.terms.time_factor = event.time_factor;
  if (event.memory_limit > 0 || event.time_factor > 0) {
    effects_.records.push_back(JobLimited{job.id, job.terms.memory_limit, job.terms.time_factor});
  }
  ResetTasks(found->second, over);
  Changed(found->second);
}

void Transition::On(PauseJob& event) {
  const auto found = state_.job_by_id.find(event.job);
  if (found == state_.job_by_id.end()) return;
  Job& job = state_.jobs[found->second];
  if (job.paused == event.paused || IsOver(job)) return;
  job.paused = event.paused;
  effects_.records.push_back(JobPaused{job.id, job.paused});
  Relist(found->second);
  Changed(found->second);
}

void Transition::On(JobForgotten& event) {
  const auto found = state_.job_by_id.find(event.job);
  if (found == state_.job_by_id.end() || !IsOver(state_.jobs[found->second])) return;
  Job& job = state_.jobs[found->second];
  for (const TaskIndex task : job.tasks) state_.tasks.Forget(task);
  job = Job{};
  state_.job_by_id.erase(found);
}

}  // namespace vorocast::core
