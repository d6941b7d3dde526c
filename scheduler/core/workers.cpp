// SPDX-License-Identifier: AGPL-3.0-or-later
#include <algorithm>
#include <utility>

#include <fmt/format.h>

#include "scheduler/core/transition.h"

namespace vorocast::core {
namespace {

/// How often tasks that take long are looked for.
constexpr absl::Duration kCopiesEvery = absl::Seconds(1);

}  // namespace

void Transition::Enlist(WorkerIndex index) {
  const Worker& worker = state_.workers[index];
  if (worker.free() > 0) state_.idle[worker.kinds].insert({-worker.free(), index});
}

void Transition::Delist(WorkerIndex index) {
  const Worker& worker = state_.workers[index];
  if (worker.free() > 0) state_.idle[worker.kinds].erase({-worker.free(), index});
}

WorkerIndex Transition::AddWorker(const std::string& name) {
  auto index = static_cast<WorkerIndex>(state_.workers.size());
  if (state_.free_workers.empty()) {
    state_.workers.emplace_back();
  } else {
    index = state_.free_workers.back();
    state_.free_workers.pop_back();
  }
  state_.workers[index].name = name;
  state_.workers[index].serial = ++state_.worker_serial;
  state_.worker_by_name.emplace(name, index);
  return index;
}

WorkerIndex Transition::Known(const std::string& name) {
  const auto found = state_.worker_by_name.find(name);
  return found == state_.worker_by_name.end() ? AddWorker(name) : found->second;
}

WorkerIndex Transition::WorkerOf(ConnectionId connection) const {
  const auto found = state_.worker_by_connection.find(connection);
  return found == state_.worker_by_connection.end() ? kNone : found->second;
}

void Transition::Hear(WorkerIndex index) {
  if (!state_.workers[index].silent) return;
  state_.workers[index].silent = false;
  Enlist(index);
}

void Transition::Renew(const Held& held, absl::Time deadline, double fraction) {
  Attempt& attempt = *held.attempt;
  state_.deadlines.erase({attempt.deadline, held.run, attempt.number});
  attempt.deadline = deadline;
  attempt.fraction = fraction;
  state_.deadlines.insert({attempt.deadline, held.run, attempt.number});
  for (const TaskIndex task : state_.runs[held.run].tasks) Changed(state_.tasks[task].job);
}

void Transition::On(WorkerConnected& event) {
  const WorkerIndex index = Known(event.worker);
  workers_changed_ = true;
  Worker& worker = state_.workers[index];
  Delist(index);
  if (worker.connection != 0) state_.worker_by_connection.erase(worker.connection);
  worker.connection = event.connection;
  worker.kinds = 0;
  for (const tasks::Kind kind : event.kinds) worker.kinds |= 1u << static_cast<unsigned>(kind);
  worker.slots = event.slots;
  worker.leaving = false;
  worker.silent = false;
  state_.worker_by_connection[event.connection] = index;
  Enlist(index);

  Welcome welcome;
  std::set<RunIndex> held;
  for (const AttemptId& id : event.holding) {
    const Held mine = FindAttempt(id);
    const bool current = mine.run != kNone && mine.attempt->worker == index;
    (current ? welcome.go_on : welcome.drop).push_back(id);
    if (!current) continue;
    held.insert(mine.run);
    Renew(mine, now_ + state_.settings.lease, mine.attempt->fraction);
  }
  Send(event.connection, std::move(welcome));
  // A lease that got lost on its way.
  const std::set<RunIndex> leased = worker.runs;
  for (const RunIndex run : leased) {
    if (!held.contains(run)) EndAttempt(AttemptOf(run, index), Cause::kWorkerLost, fmt::format("worker {} came back without it", event.worker));
  }
}

void Transition::On(WorkerDisconnected& event) {
  const WorkerIndex index = WorkerOf(event.connection);
  if (index == kNone) return;
  Delist(index);
  state_.worker_by_connection.erase(event.connection);
  state_.workers[index].connection = 0;
  absent_.push_back(index);
  workers_changed_ = true;
  for (const RunIndex run : state_.workers[index].runs) {
    const Held held = AttemptOf(run, index);
    Renew(held, std::min(held.attempt->deadline, now_ + state_.settings.grace), held.attempt->fraction);
  }
}

void Transition::On(WorkerLeaving& event) {
  const WorkerIndex index = WorkerOf(event.connection);
  if (index == kNone) return;
  Delist(index);
  state_.workers[index].leaving = true;
  workers_changed_ = true;
}

void Transition::On(Heartbeat& event) {
  const WorkerIndex index = WorkerOf(event.connection);
  if (index == kNone) return;
  Hear(index);
  Revoke unwanted;
  for (const Progress& progress : event.progress) {
    const Held held = FindAttempt(progress.id);
    if (held.run == kNone || held.attempt->worker != index) {
      unwanted.ids.push_back(progress.id);
    } else if (state_.runs[held.run].tasks.empty() && now_ > state_.adoption_ends) {
      Abandon(held.run);
    } else {
      Renew(held, now_ + state_.settings.lease, std::clamp(progress.fraction, 0.0, 1.0));
    }
  }
  if (!unwanted.ids.empty()) Send(event.connection, std::move(unwanted));
}

void Transition::On(Tick&) {
  // If this very process was stopped for a while, the workers' signs of life are still on their way.
  const absl::Duration gap = now_ - state_.last_tick;
  if (state_.last_tick != absl::InfinitePast() && gap > state_.settings.stall) {
    std::vector<RunIndex> all;
    for (const auto& [deadline, run, number] : state_.deadlines) all.push_back(run);
    std::sort(all.begin(), all.end());
    all.erase(std::unique(all.begin(), all.end()), all.end());
    for (const RunIndex run : all) {
      auto* leased = std::get_if<Leased>(&state_.runs[run].state);
      if (!leased) continue;
      for (Attempt& attempt : leased->attempts) {
        attempt.started += gap;
        Renew({run, &attempt}, attempt.deadline + gap, attempt.fraction);
      }
    }
  }
  state_.last_tick = now_;
  if (now_ > state_.adoption_ends) {
    for (const auto& [key, tries] : std::exchange(state_.tries_before, {})) effects_.records.emplace_back(std::in_place_type<RunEnded>, key);
  }
  while (!state_.deadlines.empty() && std::get<0>(*state_.deadlines.begin()) <= now_) {
    const auto [deadline, index, number] = *state_.deadlines.begin();
    if (!std::holds_alternative<Leased>(state_.runs[index].state)) {
      SetRun(index, Ready{});
      continue;
    }
    const Held held = FindAttempt({state_.runs[index].key, number});
    const WorkerIndex worker_index = held.attempt->worker;
    const Worker& worker = state_.workers[worker_index];
    if (worker.connection != 0) {
      Send(worker.connection, Revoke{{{state_.runs[index].key, number}}});
      Delist(worker_index);
      state_.workers[worker_index].silent = true;
      workers_changed_ = true;
    }
    EndAttempt(held, Cause::kWorkerLost, fmt::format("worker {} gave no sign of life", worker.name));
  }
  EndRests();
  if (now_ >= state_.copies_next) {
    state_.copies_next = now_ + kCopiesEvery;
    copies_due_ = true;
  }
}

void Transition::ForgetAbsentWorkers() {
  for (const WorkerIndex index : absent_) {
    Worker& worker = state_.workers[index];
    // One that was set aside is not forgiven for coming back.
    if (worker.name.empty() || worker.connection != 0 || !worker.runs.empty() || worker.health.set_aside) continue;
    state_.worker_by_name.erase(worker.name);
    worker = Worker{};
    state_.free_workers.push_back(index);
  }
}

}  // namespace vorocast::core
