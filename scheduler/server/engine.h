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

 private:
  friend class Engine;
  core::State& state_;
  absl::Time now_;
  std::vector<store::Record> records_;
  std::vector<std::function<void()>> after_;
  std::vector<core::Message> messages_;
  std::vector<core::LookUp> look_ups_;
  std::set<std::string> changed_jobs_;
};

using Command = std::function<void(Turn&)>;

struct EngineAdapters {
  /// Called on the engine's thread, after the commit; must not block.
  std::function<void(core::Message)> send;
  std::function<void(std::vector<core::LookUp>)> look_up;
  /// Jobs that changed since the last turn; called on every turn, also with none.
  std::function<void(Turn&, const std::set<std::string>&)> changed;
};

/// The thread that owns the core's state. Commands queue up and are worked off in turns.
class Engine {
 public:
  /// `store` must outlive the engine. When it cannot be written for half a minute the process ends: the state in memory has gone ahead of
  /// what is on record, and a fresh start is the way back.
  explicit Engine(store::Store& store) : store_(store) {}
  ~Engine() { Stop(); }

  /// Runs a command on the calling thread, before Start: nothing is sent and nobody is told, but records and look-ups count.
  void Prepare(const Command& command);
  void Start(EngineAdapters adapters);
  /// Works off what is queued, then ends the thread. Later commands are refused.
  void Stop();

  /// False when the engine has stopped or too much is waiting.
  bool Submit(Command command);
  /// For news that must not be lost however much is waiting, and whose number is bounded otherwise: an answered look-up, a stream's end.
  void Enqueue(Command command);

 private:
  void Run();
  void Commit(const std::vector<store::Record>& records);
  void Finish(Turn& turn);

  store::Store& store_;
  EngineAdapters adapters_;
  core::State state_;                         // the engine's thread, after Start
  std::vector<core::LookUp> early_look_ups_;  // from before Start
  std::mutex mutex_;
  std::condition_variable wake_;
  std::deque<Command> commands_;  // guarded by mutex_
  bool stopping_ = false;         // guarded by mutex_
  std::thread thread_;
};

/// Never jumps: what deadlines are measured with.
absl::Time MonotonicNow();

}  // namespace vorocast::server
