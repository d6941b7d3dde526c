// SPDX-License-Identifier: AGPL-3.0-or-later
#include <algorithm>
#include <utility>

#include <fmt/format.h>

#include "scheduler/core/transition.h"

namespace vorocast::core {

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
  state_.worker_by_name.emplace(name, index);
  return index;
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

void Transition::Renew(RunIndex index, absl::Time deadline, double fraction) {
  auto& leased = std::get<Leased>(state_.runs[index].state);
  state_.deadlines.erase({leased.deadline, index});
  leased.deadline = deadline;
  leased.fraction = fraction;
  state_.deadlines.insert({leased.deadline, index});
  for (const TaskIndex task : state_.runs[index].tasks) Changed(state_.tasks[task].job);
}

void Transition::On(WorkerConnected& event) {
  const auto found = state_.worker_by_name.find(event.worker);
  const WorkerIndex index = found == state_.worker_by_name.end() ? AddWorker(event.worker) : found->second;
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
    const RunIndex run = FindAttempt(id);
    const bool current = run != kNone && std::get<Leased>(state_.runs[run].state).worker == index;
    (current ? welcome.go_on : welcome.drop).push_back(id);
    if (!current) continue;
    held.insert(run);
    Renew(run, now_ + state_.settings.lease, std::get<Leased>(state_.runs[run].state).fraction);
  }
  Send(event.connection, std::move(welcome));
  // A lease that got lost on its way.
  const std::set<RunIndex> leased = worker.runs;
  for (const RunIndex run : leased) {
    if (!held.contains(run)) EndAttempt(run, Cause::kWorkerLost, fmt::format("worker {} came back without it", event.worker));
  }
}

void Transition::On(WorkerDisconnected& event) {
  const WorkerIndex index = WorkerOf(event.connection);
  if (index == kNone) return;
  Delist(index);
  state_.worker_by_connection.erase(event.connection);
  state_.workers[index].connection = 0;
  absent_.push_back(index);
  for (const RunIndex run : state_.workers[index].runs) {
    const auto& leased = std::get<Leased>(state_.runs[run].state);
    Renew(run, std::min(leased.deadline, now_ + state_.settings.grace), leased.fraction);
  }
}

void Transition::On(WorkerLeaving& event) {
  const WorkerIndex index = WorkerOf(event.connection);
  if (index == kNone) return;
  Delist(index);
  state_.workers[index].leaving = true;
}

void Transition::On(Heartbeat& event) {
  const WorkerIndex index = WorkerOf(event.connection);
  if (index == kNone) return;
  Hear(index);
  Revoke unwanted;
  for (const Progress& progress : event.progress) {
    const RunIndex run = FindAttempt(progress.id);
    if (run == kNone || std::get<Leased>(state_.runs[run].state).worker != index) {
      unwanted.ids.push_back(progress.id);
    } else if (state_.runs[run].tasks.empty() && now_ > state_.adoption_ends) {
      Abandon(run);
    } else {
      Renew(run, now_ + state_.settings.lease, std::clamp(progress.fraction, 0.0, 1.0));
    }
  }
  if (!unwanted.ids.empty()) Send(event.connection, std::move(unwanted));
}

void Transition::On(Tick&) {
  // If this very process was stopped for a while, the workers' signs of life are still on their way.
  const absl::Duration gap = now_ - state_.last_tick;
  if (state_.last_tick != absl::InfinitePast() && gap > state_.settings.stall) {
    std::vector<RunIndex> all;
    for (const auto& [deadline, run] : state_.deadlines) all.push_back(run);
    for (const RunIndex run : all) {
      if (const auto* leased = std::get_if<Leased>(&state_.runs[run].state)) Renew(run, leased->deadline + gap, leased->fraction);
    }
  }
  state_.last_tick = now_;
  if (now_ > state_.adoption_ends) {
    for (const auto& [key, tries] : std::exchange(state_.tries_before, {})) effects_.records.emplace_back(std::in_place_type<RunEnded>, key);
  }
  while (!state_.deadlines.empty() && state_.deadlines.begin()->first <= now_) {
    const RunIndex index = state_.deadlines.begin()->second;
    const auto* leased = std::get_if<Leased>(&state_.runs[index].state);
    if (!leased) {
      SetRun(index, Ready{});
      continue;
    }
    const WorkerIndex worker_index = leased->worker;
    const Worker& worker = state_.workers[worker_index];
    if (worker.connection != 0) {
      Send(worker.connection, Revoke{{{state_.runs[index].key, leased->attempt}}});
      Delist(worker_index);
      state_.workers[worker_index].silent = true;
    }
    EndAttempt(index, Cause::kWorkerLost, fmt::format("worker {} gave no sign of life", worker.name));
  }
}

void Transition::ForgetAbsentWorkers() {
  for (const WorkerIndex index : absent_) {
    Worker& worker = state_.workers[index];
    if (worker.name.empty() || worker.connection != 0 || !worker.runs.empty()) continue;
    state_.worker_by_name.erase(worker.name);
    worker = Worker{};
    state_.free_workers.push_back(index);
  }
}

}  // namespace vorocast::core
