// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <deque>
#include <functional>
#include <set>
#include <string>
#include <vector>

#include "absl/container/flat_hash_map.h"
#include "absl/time/time.h"
#include "scheduler/core/effects.h"
#include "scheduler/core/event.h"
#include "scheduler/core/state.h"

namespace vorocast::core {

/// One step's working part: a handler for each event, and what they are made of. Lives for one step.
class Transition {
 public:
  Transition(State& state, Effects& effects, absl::Time now) : state_(state), effects_(effects), now_(now) {}

  // jobs.cpp
  void On(Restored& event);
  void On(JobSubmitted& event);
  void On(TasksAdded& event);
  void On(CancelJob& event);
  void On(RetryJob& event);
  void On(JobForgotten& event);
  // runs.cpp
  void On(LookUpAnswered& event);
  void On(Finished& event);
  // workers.cpp
  void On(WorkerConnected& event);
  void On(WorkerDisconnected& event);
  void On(WorkerLeaving& event);
  void On(Heartbeat& event);
  void On(Tick& event);

  /// After the handler: lets endings flow through the graph, stops jobs that have failed too often, and hands out leases.
  void Settle();

 private:
  // Tasks (tasks.cpp).
  TaskIndex AddTask(JobIndex job, plan::PlannedTask& planned);
  /// Takes the task in (+1) or out (−1) of all its job's counters; call it around every change of its state.
  void Count(TaskIndex task, int sign);
  /// For a task that no run holds.
  void SetTask(TaskIndex task, TaskState state);
  /// The same for a task in any state: it leaves its run first.
  void Leave(TaskIndex task, TaskState state);
  /// For a blocked task whose inputs have all ended: what becomes of it.
  void Resolve(TaskIndex task);
  void Want(TaskIndex task);
  void FlowEndings();
  void StopJob(JobIndex job);
  /// Failed and cancelled tasks and all that read them, or all tasks.
  void ResetTasks(JobIndex job, bool all);

  // Runs (runs.cpp).
  void Join(RunIndex run, TaskIndex task);
  void SetRun(RunIndex run, RunState state);
  /// Enters the run in, and takes it out of, the queue, the deadlines and its worker, as its state asks for.
  void List(RunIndex run);
  void Unlist(RunIndex run);
  void EndRun(RunIndex run, const std::function<TaskState(const Task&)>& outcome);
  /// `told`: what the worker said about its end, if that is how it is known.
  void EndAttempt(RunIndex run, Cause cause, const std::string& message, const AttemptEnded& told = {});
  /// Puts the end of a leased run's attempt on record for one of its tasks.
  void RecordAttempt(const Run& run, const Task& task, AttemptEnded ended);
  /// Nobody wants its result any more.
  void Abandon(RunIndex run);
  void Save(const Run& run);
  TaskIndex First(const Run& run) const;  // its most urgent task
  RunIndex FindAttempt(const AttemptId& id) const;

  // Workers (workers.cpp).
  void Enlist(WorkerIndex worker);
  void Delist(WorkerIndex worker);
  WorkerIndex AddWorker(const std::string& name);
  WorkerIndex WorkerOf(ConnectionId connection) const;
  void Hear(WorkerIndex worker);
  void Renew(RunIndex run, absl::Time deadline, double fraction);
  void ForgetAbsentWorkers();

  // Leases (leases.cpp).
  void HandOut();
  RunIndex Choose(std::uint32_t kinds) const;
  void LeaseTo(RunIndex run, WorkerIndex worker);

  void Changed(JobIndex job) { changed_.insert(job); }
  void Send(ConnectionId connection, decltype(Message::content) content) { effects_.messages.push_back({connection, std::move(content)}); }

  State& state_;
  Effects& effects_;
  absl::Time now_;
  std::deque<TaskIndex> ended_;  // whose dependents have not been told yet
  std::vector<JobIndex> to_stop_;
  std::vector<WorkerIndex> absent_;
  std::set<JobIndex> changed_;
  absl::flat_hash_map<ConnectionId, std::size_t> leases_to_;  // index of this step's Leases message to a connection
};

}  // namespace vorocast::core
