// SPDX-License-Identifier: AGPL-3.0-or-later
// Where runs stand: with the jobs that want them while they are ready, in the clock's list, with their workers, and in the accounts of jobs and
// users while they are leased.
#include <algorithm>

#include "scheduler/core/transition.h"
#include "services/base/check.h"

namespace vorocast::core {
namespace {

constexpr std::uint32_t Bit(std::size_t kind) { return 1u << kind; }

}  // namespace

void Transition::Relist(JobIndex index) {
  Job& job = state_.jobs[index];
  std::uint32_t wanted = 0;
  if (job.is_open()) {
    for (std::size_t kind = 0; kind < kKinds; ++kind) wanted |= job.ready[kind].empty() ? 0 : Bit(kind);
  }
  const std::uint32_t changes = wanted ^ job.listed;
  if (changes == 0) return;
  job.listed = wanted;
  const auto group = state_.groups.try_emplace({job.priority, job.user}).first;
  auto& jobs = group->second.jobs;
  for (std::size_t kind = 0; kind < kKinds; ++kind) {
    if (!(changes & Bit(kind))) continue;
    wanted& Bit(kind) ? (void)jobs[kind].insert(PlaceOf(job, index)) : (void)jobs[kind].erase(PlaceOf(job, index));
  }
  if (std::all_of(jobs.begin(), jobs.end(), [](const auto& places) { return places.empty(); })) state_.groups.erase(group);
}

JobIndex Transition::JobToCharge(const Run& run) const {
  JobIndex best = kNone;
  for (const TaskIndex task : run.tasks) {
    const JobIndex index = state_.tasks[task].job;
    const Job& job = state_.jobs[index];
    if (job.starts_nothing() || !job.has_room()) continue;
    const auto urgency = [this](JobIndex of) { return std::tuple(-state_.jobs[of].priority, PlaceOf(state_.jobs[of], of)); };
    if (best == kNone || urgency(index) < urgency(best)) best = index;
  }
  return best;
}

void Transition::Charge(const Run& run, Attempt& attempt) {
  const auto is_wanted = [&](TaskIndex task) { return state_.tasks[task].job == attempt.job; };
  // Whoever it was given to keeps it on his account for as long as he wants it.
  if (!std::any_of(run.tasks.begin(), run.tasks.end(), is_wanted)) attempt.job = JobToCharge(run);
  if (attempt.job == kNone) return;
  ++state_.jobs[attempt.job].at_work;
  ++state_.leased_by_user[state_.jobs[attempt.job].user];
  Relist(attempt.job);
}

void Transition::Discharge(const Attempt& attempt) {
  if (attempt.job == kNone) return;
  --state_.jobs[attempt.job].at_work;
  const auto user = state_.leased_by_user.find(state_.jobs[attempt.job].user);
  if (--user->second == 0) state_.leased_by_user.erase(user);
  Relist(attempt.job);
}

void Transition::List(RunIndex index) {
  Run& run = state_.runs[index];
  if (std::holds_alternative<Ready>(run.state)) {
    for (const TaskIndex task : run.tasks) {
      const JobIndex job = state_.tasks[task].job;
      state_.jobs[job].ready[static_cast<std::size_t>(run.kind)].insert({task, index});
      Relist(job);
    }
  } else if (const auto* resting = std::get_if<Resting>(&run.state)) {
    state_.deadlines.insert({resting->until, index, 0});
  } else if (auto* leased = std::get_if<Leased>(&run.state)) {
    for (Attempt& attempt : leased->attempts) {
      state_.deadlines.insert({attempt.deadline, index, attempt.number});
      Delist(attempt.worker);
      state_.workers[attempt.worker].runs.insert(index);
      Enlist(attempt.worker);
      Charge(run, attempt);
    }
  }
}

void Transition::Unlist(RunIndex index) {
  Run& run = state_.runs[index];
  if (std::holds_alternative<Ready>(run.state)) {
    for (const TaskIndex task : run.tasks) {
      const JobIndex job = state_.tasks[task].job;
      VOROCAST_CHECK(state_.jobs[job].ready[static_cast<std::size_t>(run.kind)].erase({task, index}) == 1);
      Relist(job);
    }
  } else if (const auto* resting = std::get_if<Resting>(&run.state)) {
    state_.deadlines.erase({resting->until, index, 0});
  } else if (const auto* leased = std::get_if<Leased>(&run.state)) {
    for (const Attempt& attempt : leased->attempts) {
      state_.deadlines.erase({attempt.deadline, index, attempt.number});
      Delist(attempt.worker);
      state_.workers[attempt.worker].runs.erase(index);
      Enlist(attempt.worker);
      absent_.push_back(attempt.worker);
      Discharge(attempt);
    }
  }
}

}  // namespace vorocast::core
