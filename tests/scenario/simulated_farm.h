// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <cstdint>
#include <deque>
#include <map>
#include <memory>
#include <set>
#include <string>
#include <vector>

#include "absl/time/time.h"
#include "scheduler/core/step.h"
#include "scheduler/plan/plan.h"
#include "services/base/random.h"
#include "tests/scenario/simulated_store.h"

/// A farm in one thread: the scheduler's core, what its store remembers, an artifact folder, workers that die and hang, a network that loses,
/// doubles and delays, and a leader that another has replaced but that goes on. Everything follows from the seed.
namespace vorocast::scenario {

/// How often what goes wrong, each in [0, 1] per occasion.
struct Weather {
  double worker_dies = 0;      // a tick
  double worker_hangs = 0;     // a tick; for up to 30 s
  double stream_breaks = 0;    // a tick
  double message_lost = 0;     // which breaks the stream, as a stream loses nothing in its middle
  double message_doubled = 0;  // a Finished, as after a reconnect
  double attempt_fails = 0;    // for a cause drawn at random
  double bad_frame = 0;        // a frame that fails on every attempt
  double scheduler_dies = 0;   // a commit, before or after it
  double commit_unknown = 0;   // a commit: it is written, but the scheduler is told that it timed out
  double leader_replaced = 0;  // a tick: another scheduler leads, while this one was stopped and does not know
  double file_lost = 0;        // a restart of the scheduler, per result
  double user_acts = 0;        // a tick: cancels, retries under other limits, pauses, resumes, submits again
  double attempt_drags = 0;    // it takes up to two minutes longer
  double worker_sickens = 0;   // a tick: for up to a minute it fails all that it gets, at once
  double clock_jumps = 0;      // a tick: up to ten minutes ahead
};

class SimulatedFarm {
 public:
  SimulatedFarm(std::uint64_t seed, Weather weather);

  /// Until every job has ended and every worker is idle, or something is wrong. INTERNAL says what.
  absl::Status Run();

  std::int64_t steps() const { return steps_; }
  /// Writes of replaced leaders, all of them refused.
  std::int64_t refused() const { return refused_; }
  /// Second attempts, and steps with a worker set aside.
  std::int64_t copied() const { return copied_; }
  std::int64_t set_aside() const { return set_aside_; }

 private:
  struct Attempt {
    core::AttemptId id;
    std::string spec_json;
    absl::Time ends;
    std::optional<core::Finished> report;  // once ended
  };
  struct SimulatedWorker {
    std::string name;
    std::vector<tasks::Kind> kinds;
    std::int32_t slots = 1;
    core::ConnectionId connection = 0;  // 0: not connected
    bool welcomed = false;
    absl::Time sick_until = absl::InfinitePast();
    absl::Time silent_until = absl::InfinitePast();
    absl::Time connects_at;
    absl::Time beats_at;
    std::map<core::AttemptId, Attempt> held;
  };
  /// On its way to the scheduler, in the order of its stream.
  struct ToScheduler {
    absl::Time at;
    core::Event event;
  };
  struct ToWorker {
    absl::Time at;
    core::Message message;
  };

  /// A scheduler that led before, and does not know yet that it leads no more.
  struct Replaced {
    std::int64_t term = 0;
    core::State state;
    std::deque<ToScheduler> answers;
    absl::Time wakes_at;
    absl::Time learns_at;  // at the latest
  };

  bool Chance(double probability) { return random_.Uniform() < probability; }
  absl::Duration Delay() { return absl::Milliseconds(1 + static_cast<std::int64_t>(random_.Below(50))); }

  void SubmitJobs();
  absl::Status Happen(core::Event event);
  absl::Status Check(const core::State& state) const;
  absl::Status Apply(core::Effects effects);
  absl::Status Commit(const std::vector<core::Record>& records);
  void Send(std::vector<core::Message> messages);
  core::LookUpAnswered Answer(const core::LookUp& look_up) const;
  absl::Status Restart();
  absl::Status Lead();
  absl::Status Plan(const SimulatedStore::SubmittedJob& job);

  // A leader that was replaced (simulated_takeover.cpp).
  absl::Status Replace();
  absl::Status HappenToReplaced(core::Event event);
  absl::Status MoveReplaced();
  void EndReplaced();

  absl::Status Deliver();
  absl::Status DeliverAnswers();
  absl::Status Tick();
  void MoveWorker(SimulatedWorker& worker);
  void Connect(SimulatedWorker& worker);
  void Break(core::ConnectionId connection);
  void Receive(const core::Message& message);
  void StartAttempt(SimulatedWorker& worker, const core::Lease& lease);
  core::Finished Outcome(const SimulatedWorker& worker, const Attempt& attempt);
  void Post(core::ConnectionId connection, core::Event event);
  static core::JobSubmitted Submission(const SimulatedStore::SubmittedJob& job);
  absl::Status ActAsUser();
  absl::Status ResumeAll();
  bool IsOver() const;
  absl::Status CheckEnd() const;
  absl::Status Wrong(const std::string& what) const;

  base::Random random_;
  Weather weather_;
  bool calm_ = false;  // after a while nothing goes wrong any more, so that everything must end
  absl::Time now_ = absl::UnixEpoch();
  absl::Time calm_at_;
  std::int64_t steps_ = 0;
  std::vector<plan::PlannedFrame> frames_;
  std::set<std::int32_t> bad_frames_;
  std::size_t frames_known_ = 0;
  bool closed_ = false;

  core::State state_;
  bool starting_ = false;  // nothing goes wrong while a leader takes up what the store remembers, as nobody is served yet
  std::int64_t term_ = 0;
  SimulatedStore memory_;
  std::optional<Replaced> replaced_;
  std::set<core::ConnectionId> to_replaced_;  // streams that end there, or ended there before it was gone
  std::int64_t refused_ = 0;
  std::int64_t copied_ = 0;
  std::int64_t set_aside_ = 0;
  std::set<base::Digest> files_;                   // results in the artifact folder
  std::map<base::Digest, std::int32_t> accepted_;  // how often a result was taken for a key since its file was last lost
  core::ConnectionId last_connection_ = 0;
  std::int64_t last_worker_ = 0;
  std::vector<SimulatedWorker> workers_;
  std::map<core::ConnectionId, std::deque<ToScheduler>> to_scheduler_;
  std::map<core::ConnectionId, std::deque<ToWorker>> to_worker_;
  std::deque<ToScheduler> answers_;  // of look-ups
};

}  // namespace vorocast::scenario
