// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <condition_variable>
#include <deque>
#include <functional>
#include <memory>
#include <mutex>
#include <set>
#include <string>
#include <thread>
#include <vector>

#include "scheduler/core/effects.h"
#include "scheduler/core/event.h"
#include "scheduler/core/state.h"
#include "scheduler/store/store.h"

namespace vorocast::server {

/// One round of the engine's thread: commands work on the state, then everything they recorded is committed at once, then what they
/// asked for afterwards is done.
class Turn {
 public:
  Turn(core::State& state, absl::Time now) : state_(state), now_(now) {}

  const core::State& state() const { return state_; }
  /// One step of the core.
  void Apply(core::Event event);
  void Record(store::Record record) { records_.push_back(std::move(record)); }
  /// Once the records of this turn are durable.
  void After(std::function<void()> action) { after_.push_back(std::move(action)); }
  /// For somebody who waits: called once, with OK when the records of this turn are durable, or with the reason why that takes a while.
  void Answer(std::function<void(const absl::Status&)> answer) { answers_.push_back(std::move(answer)); }

 private:
  friend class Engine;
  core::State& state_;
  absl::Time now_;
  std::vector<store::Record> records_;
  std::vector<std::function<void()>> after_;
  std::vector<std::function<void(const absl::Status&)>> answers_;
  std::vector<core::Message> messages_;
  std::vector<core::LookUp> look_ups_;
  std::set<std::string> changed_jobs_;
};

using Command = std::function<void(Turn&)>;

struct EngineAdapters {
  /// Called on the engine's thread, after the commit; must not block.
  std::function<void(core::Message)> send;
  std::function<void(std::vector<core::LookUp>)> look_up;
  /// Jobs that this turn's commands changed; called on every turn, also with none. What it changes itself belongs to the next turn's jobs.
  std::function<void(Turn&, const std::set<std::string>&)> changed;
  /// These records have been made durable; called on the engine's thread.
  std::function<void(const std::vector<store::Record>&, absl::Duration took)> committed;
  /// The store cannot be written for now; called on the engine's thread, once each time this begins.
  std::function<void(const absl::Status&)> stalled;
};

/// The thread that owns the core's state. Commands queue up and are worked off in turns.
class Engine {
 public:
  /// Told when nothing can be written any more: another scheduler leads (FAILED_PRECONDITION), or the store is damaged (DATA_LOSS). The state in
  /// memory has gone ahead of what is on record then, so a fresh start is the only way back.
  using Lost = std::function<void(const absl::Status&)>;
  /// `store` must outlive the engine. While it cannot be written (a full disk, a database that is away) the engine waits and goes on by itself;
  /// who asks meanwhile is told why.
  Engine(store::Store& store, Lost lost) : store_(store), lost_(std::move(lost)) {}
  ~Engine() { Stop(); }

  /// Runs a command on the calling thread, before Start: nothing is sent and nobody is told, but records and look-ups count.
  void Prepare(const Command& command);
  void Start(EngineAdapters adapters);
  /// Works off what is queued, then ends the thread. Later commands are refused.
  void Stop();

  /// False when the engine has stopped or too much is waiting.
  bool Submit(Command command);
  /// The same for calls that somebody waits for, refused also while the store cannot be written: the status says why.
  absl::Status Ask(Command command);
  /// For news that must not be lost however much is waiting, and whose number is bounded otherwise: an answered look-up, a stream's end.
  void Enqueue(Command command);
  /// Commands that wait.
  std::size_t waiting();

 private:
  void Run();
  /// The next command; empty when none waits.
  Command Next();
  /// When OK the turn's records are durable; an error is final.
  absl::Status Commit(Turn& turn);
  void NoteStalled(Turn& turn, const absl::Status& status);
  absl::Status Finish(Turn& turn);

  store::Store& store_;
  const Lost lost_;
  EngineAdapters adapters_;
  core::State state_;                         // the engine's thread, after Start
  std::vector<core::LookUp> early_look_ups_;  // from before Start
  std::set<std::string> changed_late_;        // the engine's thread: since the last turn's adapters were told
  std::mutex mutex_;
  std::condition_variable wake_;
  std::deque<Command> asked_;     // guarded by mutex_; somebody waits for these
  bool was_asked_ = false;        // guarded by mutex_; the last command was one of them
  std::deque<Command> commands_;  // guarded by mutex_
  bool stopping_ = false;         // guarded by mutex_
  absl::Status stalled_;          // guarded by mutex_; why the store cannot be written, or OK
  std::thread thread_;
};

/// Never jumps: what leases are measured with.
absl::Time MonotonicNow();
/// What people's clocks say, in seconds since 1970.
double WallSeconds();

}  // namespace vorocast::server
