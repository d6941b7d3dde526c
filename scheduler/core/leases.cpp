// SPDX-License-Identifier: AGPL-3.0-or-later
#include <algorithm>

#include "scheduler/core/transition.h"
#include "services/base/check.h"

namespace vorocast::core {
namespace {

/// Attempt numbers are reserved in blocks, so that most leases need no record of their own for it.
constexpr std::int64_t kAttemptBlock = 1000;

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
      const RunIndex run = Choose(kinds);
      if (run == kNone) break;
      LeaseTo(run, idle.begin()->second);
    }
  }
}

RunIndex Transition::Choose(std::uint32_t kinds) const {
  // Among the users of the highest priority with something ready: who has the fewest leases, then whose job is the oldest.
  using Rank = std::pair<std::int32_t, Place>;
  std::optional<Rank> best;
  std::int32_t best_priority = 0;
  for (const auto& [key, group] : state_.groups) {
    if (best && key.priority < best_priority) break;
    const auto leased = state_.leased_by_user.find(key.user);
    for (std::size_t kind = 0; kind < kKinds; ++kind) {
      if (!(kinds & (1u << kind)) || group.ready[kind].empty()) continue;
      const Rank rank{leased == state_.leased_by_user.end() ? 0 : leased->second, *group.ready[kind].begin()};
      if (best && !(rank < *best)) continue;
      best = rank;
      best_priority = key.priority;
    }
  }
  return best ? std::get<2>(best->second) : kNone;
}

void Transition::LeaseTo(RunIndex index, WorkerIndex worker_index) {
  const std::int64_t attempt = state_.attempt_next++;
  if (attempt >= state_.attempt_reserved) {
    state_.attempt_reserved = attempt + kAttemptBlock;
    effects_.records.push_back(AttemptsReserved{state_.attempt_reserved});
  }
  SetRun(index, Leased{.attempt = attempt, .worker = worker_index, .deadline = now_ + state_.settings.lease, .started = now_});
  Run& run = state_.runs[index];
  run.saved = true;
  Save(run);

  const ConnectionId connection = state_.workers[worker_index].connection;
  const auto [sent, is_new] = leases_to_.emplace(connection, effects_.messages.size());
  if (is_new) Send(connection, Leases{});
  const Task& task = state_.tasks[First(run)];
  std::get<Leases>(effects_.messages[sent->second].content)
      .leases.push_back({.id = {run.key, attempt},
                         .label = task.name,
                         .spec_json = ToJson(SpecOf(state_, task)).dump(),
                         .memory_limit = state_.settings.memory_limit << std::min(run.tries.memory_raised, kMemoryRaisedMax),
                         .time_limit = TimeLimit(task.kind)});
}

}  // namespace vorocast::core
