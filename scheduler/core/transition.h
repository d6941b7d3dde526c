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
  void On(PauseJob& event);
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
  void EndRun(RunIndex run, const std::function<TaskState(const Task&)>& outcome);
  /// An attempt and the run that it belongs to; kNone for a stale one. The pointer holds until the run's state changes.
  struct Held {
    RunIndex run = kNone;
    Attempt* attempt = nullptr;
  };
  /// `told`: what the worker said about its end, if that is how it is known.
  void EndAttempt(const Held& held, Cause cause, const std::string& message, const AttemptEnded& told = {});
  /// Puts the end of an attempt at a run on record for one of its tasks, or for all of them.
  void RecordAttempt(const Attempt& attempt, const Task& task, AttemptEnded ended);
  void RecordAttempt(const Attempt& attempt, const Run& run, const AttemptEnded& ended);
  /// Of two; the other goes on.
  void DropAttempt(RunIndex run, std::int64_t number);
  /// Their results are not wanted any more.
  void RevokeOthers(RunIndex run, std::int64_t ended);
  /// Nobody wants its result any more.
  void Abandon(RunIndex run);
  void Save(const Run& run);
  TaskIndex First(const Run& run) const;  // its most urgent task
  Held FindAttempt(const AttemptId& id);
  Held AttemptOf(RunIndex run, WorkerIndex worker);
  Attempt Remembered(std::int64_t number, WorkerIndex worker) const;

  // The queue and the accounts (queue.cpp).
  /// Enters the run in, and takes it out of, the queue, the deadlines, its workers and the accounts, as its state asks for.
  void List(RunIndex run);
  void Unlist(RunIndex run);
  /// Brings the job's place in its group in line with what it has ready and whether it may be given workers.
  void Relist(JobIndex job);
  /// The most urgent job that wants the run and has room for one more attempt; kNone if there is none.
  JobIndex JobToCharge(const Run& run) const;
  void Charge(const Run& run, Attempt& attempt);
  void Discharge(const Attempt& attempt);

  // Workers (workers.cpp).
  void Enlist(WorkerIndex worker);
  void Delist(WorkerIndex worker);
  WorkerIndex AddWorker(const std::string& name);
  WorkerIndex Known(const std::string& name);  // added if need be
  WorkerIndex WorkerOf(ConnectionId connection) const;
  void Hear(WorkerIndex worker);
  void Renew(const Held& held, absl::Time deadline, double fraction);
  void ForgetAbsentWorkers();

  // Which workers can be trusted (health.cpp).
  void NoteSuccess(const Run& run, WorkerIndex worker);
  void NoteFailure(Run& run, WorkerIndex worker);
  bool IsSuspect(const Worker& worker) const;
  /// Whether the others can do all that this one does, and do it well.
  bool AreOthersSound(WorkerIndex worker) const;
  void SetAside(WorkerIndex worker);
  void EndRests();
  /// When nobody else is left for what they do, the fault is not theirs.
  void TakeBackTheLast();
  /// Whether others should go first: it failed here, and there are others.
  bool IsAvoided(const Run& run, const Worker& worker) const;

  // Leases (leases.cpp).
  void HandOut();
  struct Choice {
    JobIndex job = kNone;
    RunIndex run = kNone;
  };
  Choice Choose(std::uint32_t kinds) const;
  WorkerIndex ChooseWorker(const Run& run, const std::set<std::pair<std::int32_t, WorkerIndex>>& idle) const;
  void LeaseTo(const Choice& choice, WorkerIndex worker);
  std::int64_t NextAttempt();
  void SendLease(const Run& run, const Attempt& attempt);

  // Second attempts (copies.cpp).
  void CopyStragglers();
  /// How many medians of its kind the attempt takes longer than it should; 0 when it is none to copy.
  double Overdue(const Run& run, const Attempt& attempt) const;

  void Changed(JobIndex job) { changed_.insert(job); }
  void Send(ConnectionId connection, decltype(Message::content) content) { effects_.messages.push_back({connection, std::move(content)}); }

  State& state_;
  Effects& effects_;
  absl::Time now_;
  std::deque<TaskIndex> ended_;  // whose dependents have not been told yet
  std::vector<JobIndex> to_stop_;
  std::vector<WorkerIndex> absent_;
  bool workers_changed_ = false;  // some are gone, or were set aside
  bool copies_due_ = false;
  std::set<JobIndex> changed_;
  absl::flat_hash_map<ConnectionId, std::size_t> leases_to_;  // index of this step's Leases message to a connection
};

}  // namespace vorocast::core
