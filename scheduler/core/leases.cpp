// SPDX-License-Identifier: AGPL-3.0-or-later
#include <algorithm>

#include "scheduler/core/transition.h"
#include "services/base/check.h"

namespace vorocast::core {
namespace {

/// Attempt numbers are reserved in blocks, so that most leases need no record of their own for it.
constexpr std::int64_t kAttemptBlock = 1000;
/// So long a task waits for a worker that has not failed it, before it is looked at again.
constexpr absl::Duration kAvoidRest = absl::Milliseconds(500);

/// Far above what each kind should need: only an attempt that will never end is stopped.
absl::Duration TimeLimit(tasks::Kind kind) {
  switch (kind) {
    case tasks::Kind::kTessellate:
      return absl::Minutes(20);
    case tasks::Kind::kTemplate:
    case tasks::Kind::kSheet:
    case tasks::Kind::kRender:
      return absl::Hours(1);
    case tasks::Kind::kStretch:
    case tasks::Kind::kTrack:
      return absl::Hours(2);
    case tasks::Kind::kGuide:
    case tasks::Kind::kAssemble:
    case tasks::Kind::kEncode:
      return absl::Hours(4);
    case tasks::Kind::kSimulate:
      return absl::Hours(24);
  }
  VOROCAST_CHECK(false && "unknown kind");
}

}  // namespace

void Transition::HandOut() {
  for (auto& [kinds, idle] : state_.idle) {
    while (!idle.empty()) {
      const Choice choice = Choose(kinds);
      if (choice.run == kNone) break;
      const WorkerIndex worker = ChooseWorker(state_.runs[choice.run], idle);
      worker == kNone ? SetRun(choice.run, Resting{now_ + kAvoidRest}) : LeaseTo(choice, worker);
    }
  }
}

Transition::Choice Transition::Choose(std::uint32_t kinds) const {
  // Among the users of the highest priority with something ready: who has the fewest slots at work; then the earliest deadline, the oldest job,
  // and the order of its plan.
  using Rank = std::tuple<std::int32_t, JobPlace, TaskIndex, RunIndex>;
  std::optional<Rank> best;
  std::int32_t best_priority = 0;
  for (const auto& [key, group] : state_.groups) {
    if (best && key.priority < best_priority) break;
    const auto leased = state_.leased_by_user.find(key.user);
    for (std::size_t kind = 0; kind < kKinds; ++kind) {
      if (!(kinds & (1u << kind)) || group.jobs[kind].empty()) continue;
      const JobPlace place = *group.jobs[kind].begin();
      const auto& [task, run] = *state_.jobs[place.second].ready[kind].begin();
      const Rank rank{leased == state_.leased_by_user.end() ? 0 : leased->second, place, task, run};
      if (best && !(rank < *best)) continue;
      best = rank;
      best_priority = key.priority;
    }
  }
  if (!best) return {};
  return {std::get<1>(*best).second, std::get<3>(*best)};
}

WorkerIndex Transition::ChooseWorker(const Run& run, const std::set<std::pair<std::int32_t, WorkerIndex>>& idle) const {
  if (run.failed_on.empty() || now_ >= run.avoid_until) return idle.begin()->second;
  for (const auto& [free, worker] : idle) {
    if (!IsAvoided(run, state_.workers[worker])) return worker;
  }
  const auto could = [&](const Worker& worker) {
    return worker.is_there() && !worker.health.set_aside && (worker.kinds & (1u << static_cast<unsigned>(run.kind))) && !IsAvoided(run, worker);
  };
  return std::any_of(state_.workers.begin(), state_.workers.end(), could) ? kNone : idle.begin()->second;
}

void Transition::LeaseTo(const Choice& choice, WorkerIndex worker) {
  const Tries& tries = state_.runs[choice.run].tries;
  Leased leased;
  leased.attempts.push_back({.number = NextAttempt(),
                             .worker = worker,
                             .deadline = now_ + state_.settings.lease,
                             .started = now_,
                             .job = choice.job,
                             .memory_raised = tries.memory_raised,
                             .time_raised = tries.time_raised});
  SetRun(choice.run, leased);
  Run& run = state_.runs[choice.run];
  run.saved = true;
  Save(run);
  SendLease(run, leased.attempts.front());
}

std::int64_t Transition::NextAttempt() {
  const std::int64_t attempt = state_.attempt_next++;
  if (attempt >= state_.attempt_reserved) {
    state_.attempt_reserved = attempt + kAttemptBlock;
    effects_.records.push_back(AttemptsReserved{state_.attempt_reserved});
  }
  return attempt;
}

void Transition::SendLease(const Run& run, const Attempt& attempt) {
  const ConnectionId connection = state_.workers[attempt.worker].connection;
  const auto [sent, is_new] = leases_to_.emplace(connection, effects_.messages.size());
  if (is_new) Send(connection, Leases{});
  // Who shares a result shares the widest of the limits.
  std::int64_t memory_limit = 0;
  double time_factor = 0;
  for (const TaskIndex task : run.tasks) {
    const JobTerms& terms = state_.jobs[state_.tasks[task].job].terms;
    memory_limit = std::max(memory_limit, terms.memory_limit > 0 ? terms.memory_limit : state_.settings.memory_limit);
    time_factor = std::max(time_factor, terms.time_factor);
  }
  const Task& task = state_.tasks[First(run)];
  std::get<Leases>(effects_.messages[sent->second].content)
      .leases.push_back({.id = {run.key, attempt.number},
                         .label = task.name,
                         .spec_json = ToJson(SpecOf(state_, task)).dump(),
                         .memory_limit = memory_limit << attempt.memory_raised,
                         .time_limit = TimeLimit(task.kind) * time_factor * (1 << attempt.time_raised)});
}

}  // namespace vorocast::core
