// SPDX-License-Identifier: AGPL-3.0-or-later
#include "tests/scenario/simulated_farm.h"

#include <algorithm>
#include <utility>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "scheduler/core/check.h"
#include "scheduler/core/job_view.h"
#include "tests/scenario/choice_oracle.h"

namespace vorocast::scenario {
namespace {

constexpr absl::Duration kTick = absl::Milliseconds(100);
constexpr absl::Duration kPatience = absl::Minutes(30);  // of simulated calm, after which what has not ended is stuck
constexpr std::int64_t kWorkers = 4;
constexpr std::int64_t kKeysEvery = 97;  // steps; no divisor of anything that repeats

}  // namespace

SimulatedFarm::SimulatedFarm(std::uint64_t seed, Weather weather) : random_(seed), weather_(weather), calm_at_(now_ + absl::Seconds(60)) {
  const auto count = static_cast<std::int32_t>(2 + random_.Below(9));
  for (std::int32_t i = 0; i < count; ++i) {
    frames_.push_back({.number = i, .blob = base::HashBytes(fmt::format("frame {}", i)), .extension = ".ply"});
    if (Chance(weather_.bad_frame)) bad_frames_.insert(i);
  }
  for (std::int64_t i = 0; i < kWorkers; ++i) {
    SimulatedWorker worker{.name = fmt::format("worker-{}", ++last_worker_), .slots = static_cast<std::int32_t>(1 + random_.Below(3))};
    for (const tasks::Kind kind : tasks::kAllKinds) {
      if ((kind == tasks::Kind::kSimulate) == (i == 0)) worker.kinds.push_back(kind);
    }
    worker.connects_at = now_ + Delay();
    workers_.push_back(std::move(worker));
  }
  SubmitJobs();
}

absl::Status SimulatedFarm::Wrong(const std::string& what) const { return absl::InternalError(fmt::format("after {} steps: {}", steps_, what)); }

absl::Status SimulatedFarm::Check(const core::State& state) const {
  if (const absl::Status status = core::Check(state, steps_ % kKeysEvery == 0); !status.ok()) return Wrong(std::string(status.message()));
  return absl::OkStatus();
}

absl::Status SimulatedFarm::Happen(core::Event event) {
  ++steps_;
  const auto* finished = std::get_if<core::Finished>(&event);
  const bool succeeded = finished && std::holds_alternative<core::Succeeded>(finished->outcome);
  const base::Digest key = finished ? finished->id.key : base::Digest{};
  const bool is_tick = std::holds_alternative<core::Tick>(event);
  set_aside_ += !state_.set_aside.empty();
  // What a restart takes up was decided by somebody else.
  const auto* restored = std::get_if<core::Restored>(&event);
  const std::int64_t attempt_next = restored ? restored->attempt_next : state_.attempt_next;
  core::Effects effects = core::Step(state_, std::move(event), now_);
  if (const absl::Status status = CheckChoices(state_, attempt_next); !status.ok()) return Wrong(std::string(status.message()));
  const bool idle = is_tick && effects.records.empty() && effects.messages.empty() && effects.changed_jobs.empty();
  if (!idle) RETURN_IF_ERROR(Check(state_));
  for (const core::Record& record : effects.records) {
    const auto* made = std::get_if<core::ResultMade>(&record);
    if (made && succeeded && made->key != key) return Wrong("a result for another key than was reported");
  }
  return Apply(std::move(effects));
}

absl::Status SimulatedFarm::Apply(core::Effects effects) {
  const bool risky = !effects.records.empty() && !calm_ && !starting_;
  const bool dies = risky && Chance(weather_.scheduler_dies);
  if (dies && Chance(0.5)) return Restart();  // before the commit: nothing of this step is remembered, nothing was sent
  RETURN_IF_ERROR(Commit(effects.records));
  if (dies) return Restart();  // after the commit: remembered, but nobody was told
  if (risky && Chance(weather_.commit_unknown)) {
    if (Chance(0.3)) return Replace();  // before it could try again
    const std::string before = memory_.Text();
    RETURN_IF_ERROR(memory_.Append(term_, effects.records));
    if (memory_.Text() != before) return Wrong("writing a batch again was not harmless");
  }
  Send(std::move(effects.messages));
  for (const core::LookUp& look_up : effects.look_ups) answers_.push_back({now_ + Delay(), Answer(look_up)});
  return absl::OkStatus();
}

absl::Status SimulatedFarm::Commit(const std::vector<core::Record>& records) {
  for (const core::Record& record : records) {
    const auto* saved = std::get_if<core::RunSaved>(&record);
    copied_ += saved && !saved->copy_worker.empty();
    const auto* made = std::get_if<core::ResultMade>(&record);
    if (made && ++accepted_[made->key] > 1) return Wrong(fmt::format("the result {} was accepted twice", made->key.Short()));
  }
  return memory_.Append(term_, records);
}

void SimulatedFarm::Send(std::vector<core::Message> messages) {
  for (core::Message& message : messages) {
    const auto stream = to_worker_.find(message.connection);
    if (stream == to_worker_.end()) continue;
    if (!calm_ && Chance(weather_.message_lost)) {
      Break(message.connection);
      continue;
    }
    const absl::Time after = stream->second.empty() ? now_ : stream->second.back().at;
    stream->second.push_back({std::max(after, now_ + Delay()), std::move(message)});
  }
}

core::LookUpAnswered SimulatedFarm::Answer(const core::LookUp& look_up) const {
  core::LookUpAnswered answer{.key = look_up.key};
  if (!files_.contains(look_up.key)) return answer;
  const auto recorded = memory_.results.find(look_up.key);
  answer.recorded = recorded != memory_.results.end();
  answer.result = answer.recorded ? recorded->second : core::Result{.sha256 = look_up.key, .size = 1};
  return answer;
}

absl::Status SimulatedFarm::Plan(const SimulatedStore::SubmittedJob& job) {
  const std::vector<plan::PlannedFrame> known(frames_.begin(), frames_.begin() + static_cast<std::ptrdiff_t>(frames_known_));
  auto planned = plan::Plan(job.spec, known, closed_);
  if (!planned.ok()) return planned.status();
  core::TasksAdded added{.job = job.id, .tasks = *std::move(planned), .complete = closed_};
  if (job.spec.interpolated_max >= 0) added.bad_frames_max = job.spec.interpolated_max;
  if (closed_) added.bad_frames_max = plan::InterpolatedMax(job.spec, static_cast<std::int32_t>(frames_.size()));
  return Happen(std::move(added));
}

absl::Status SimulatedFarm::Restart() {
  for (const auto& [connection, stream] : std::map(to_worker_)) {
    if (!to_replaced_.contains(connection)) Break(connection);
  }
  for (auto file = files_.begin(); file != files_.end();) {
    if (!calm_ && accepted_.contains(*file) && Chance(weather_.file_lost)) {
      accepted_.erase(*file);
      file = files_.erase(file);
    } else {
      ++file;
    }
  }
  now_ += absl::Milliseconds(static_cast<std::int64_t>(random_.Below(3000)));
  return Lead();
}

absl::Status SimulatedFarm::Lead() {
  term_ = memory_.Lead();
  state_ = core::State{};
  answers_.clear();
  starting_ = true;
  core::Restored restored{.attempt_next = memory_.attempt_next};
  for (const auto& [key, run] : memory_.runs) restored.runs.push_back(run);
  absl::Status status = Happen(std::move(restored));
  for (std::size_t i = 0; status.ok() && i < memory_.jobs.size(); ++i) {
    const SimulatedStore::SubmittedJob job = memory_.jobs[i];
    status = Happen(Submission(job));
    if (status.ok()) status = Plan(job);
  }
  starting_ = false;
  return status;
}

absl::Status SimulatedFarm::Deliver() {
  // Streams among each other in any order: the one that is looked at first changes with every tick.
  std::vector<core::ConnectionId> order;
  for (const auto& [connection, stream] : to_scheduler_) order.push_back(connection);
  for (std::size_t i = order.size(); i > 1; --i) std::swap(order[i - 1], order[random_.Below(i)]);
  for (const core::ConnectionId connection : order) {
    auto& stream = to_scheduler_[connection];
    const auto is_heard = [&] { return !replaced_ || !to_replaced_.contains(connection) || now_ >= replaced_->wakes_at; };
    while (is_heard() && !stream.empty() && stream.front().at <= now_) {
      core::Event event = std::move(stream.front().event);
      stream.pop_front();
      const bool last = std::holds_alternative<core::WorkerDisconnected>(event);
      RETURN_IF_ERROR(to_replaced_.contains(connection) ? HappenToReplaced(std::move(event)) : Happen(std::move(event)));
      if (last) break;
    }
    if (stream.empty() && !to_worker_.contains(connection)) to_scheduler_.erase(connection);
  }
  RETURN_IF_ERROR(DeliverAnswers());
  for (const auto& [connection, unused] : std::map(to_worker_)) {
    auto stream = to_worker_.find(connection);
    while (stream != to_worker_.end() && !stream->second.empty() && stream->second.front().at <= now_) {
      const core::Message message = std::move(stream->second.front().message);
      stream->second.pop_front();
      Receive(message);
      stream = to_worker_.find(connection);
    }
  }
  return absl::OkStatus();
}

absl::Status SimulatedFarm::DeliverAnswers() {
  while (!answers_.empty()) {
    const std::size_t which = random_.Below(answers_.size());
    if (answers_[which].at > now_) break;
    core::Event event = std::move(answers_[which].event);
    answers_.erase(answers_.begin() + static_cast<std::ptrdiff_t>(which));
    RETURN_IF_ERROR(Happen(std::move(event)));
  }
  return absl::OkStatus();
}

absl::Status SimulatedFarm::Tick() {
  now_ += kTick;
  if (!calm_ && Chance(weather_.clock_jumps)) now_ += absl::Seconds(static_cast<std::int64_t>(random_.Below(600)));
  const bool was_calm = std::exchange(calm_, now_ >= calm_at_);
  if (calm_ && !was_calm) RETURN_IF_ERROR(ResumeAll());
  // The take grows for a while, then it is closed.
  if (!closed_ && (calm_ || Chance(0.1))) {
    frames_known_ = std::min(frames_.size(), frames_known_ + 1 + random_.Below(3));
    if (calm_) frames_known_ = frames_.size();
    closed_ = frames_known_ == frames_.size() && (calm_ || Chance(0.5));
    for (std::size_t i = 0; i < memory_.jobs.size(); ++i) RETURN_IF_ERROR(Plan(SimulatedStore::SubmittedJob(memory_.jobs[i])));
  }
  if (!calm_ && Chance(weather_.user_acts)) RETURN_IF_ERROR(ActAsUser());
  if (!calm_ && Chance(weather_.leader_replaced)) RETURN_IF_ERROR(Replace());
  RETURN_IF_ERROR(MoveReplaced());
  for (SimulatedWorker& worker : workers_) MoveWorker(worker);
  RETURN_IF_ERROR(Deliver());
  return Happen(core::Tick{});
}

bool SimulatedFarm::IsOver() const {
  if (!closed_) return false;
  for (const core::Job& job : state_.jobs) {
    if (core::PhaseOf(job) == core::Phase::kRunning) return false;
  }
  return std::all_of(workers_.begin(), workers_.end(), [](const SimulatedWorker& worker) { return worker.held.empty(); });
}

absl::Status SimulatedFarm::CheckEnd() const {
  if (const absl::Status status = core::Check(state_); !status.ok()) return Wrong(std::string(status.message()));
  for (const SimulatedStore::SubmittedJob& submitted : memory_.jobs) {
    const core::Job* job = core::FindJob(state_, submitted.id);
    if (!job) return Wrong(fmt::format("{} is not known", submitted.id));
    const core::Phase phase = core::PhaseOf(*job);
    const auto bad_max = plan::InterpolatedMax(submitted.spec, static_cast<std::int32_t>(frames_.size()));
    const bool too_bad = static_cast<std::int32_t>(bad_frames_.size()) > bad_max;
    if (phase == core::Phase::kCancelled && !submitted.cancelled) return Wrong(fmt::format("{} was cancelled by nobody", submitted.id));
    if (phase == core::Phase::kDone && too_bad) return Wrong(fmt::format("{} is done in spite of {} bad frames", submitted.id, bad_frames_.size()));
    if (phase == core::Phase::kFailed && !too_bad && submitted.failures.empty()) return Wrong(fmt::format("{} failed for nothing", submitted.id));
    for (const core::TaskIndex index : job->tasks) {
      const core::Task& task = state_.tasks[index];
      if (!core::HasEnded(task)) return Wrong(fmt::format("{} of {} has not ended", task.name, submitted.id));
      if (const auto* done = std::get_if<core::Done>(&task.state); done && !files_.contains(done->key))
        return Wrong(fmt::format("{} has no file", task.name));
    }
  }
  for (const auto& [key, run] : memory_.runs) {
    if (!state_.run_by_key.contains(key) && !state_.tries_before.contains(key))
      return Wrong(fmt::format("the run {} is on record for ever", key.Short()));
  }
  return absl::OkStatus();
}

absl::Status SimulatedFarm::Run() {
  term_ = memory_.Lead();
  RETURN_IF_ERROR(Happen(core::Restored{}));
  for (std::size_t i = 0; i < memory_.jobs.size(); ++i) {
    const SimulatedStore::SubmittedJob job = memory_.jobs[i];
    RETURN_IF_ERROR(Happen(Submission(job)));
  }
  while (!IsOver()) {
    RETURN_IF_ERROR(Tick());
    if (now_ > calm_at_ + kPatience) {
      for (const core::Job& job : state_.jobs) {
        if (core::PhaseOf(job) == core::Phase::kRunning) return Wrong(fmt::format("stuck: {}", core::Explain(state_, job)));
      }
      return Wrong("a worker holds something for ever");
    }
  }
  return CheckEnd();
}

}  // namespace vorocast::scenario
