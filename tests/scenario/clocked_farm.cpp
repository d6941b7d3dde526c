// SPDX-License-Identifier: AGPL-3.0-or-later
#include "tests/scenario/clocked_farm.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <queue>
#include <string>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "scheduler/core/job_view.h"
#include "scheduler/core/step.h"
#include "services/base/check.h"
#include "services/base/random.h"

namespace vorocast::scenario {
namespace {

constexpr absl::Duration kTick = absl::Milliseconds(250);
constexpr double kPatienceS = 1e7;

/// The farm's mail, in the order of time and, at one time, of posting.
struct Mail {
  absl::Time at;
  std::int64_t number = 0;
  core::Event event;
  friend bool operator>(const Mail& a, const Mail& b) { return a.at != b.at ? a.at > b.at : a.number > b.number; }
};

std::uint64_t Number(const base::Digest& digest) {
  std::uint64_t number = 0;
  for (std::size_t i = 0; i < 8; ++i) number = number << 8 | digest.bytes[i];
  return number;
}

class ClockedFarm {
 public:
  explicit ClockedFarm(const FarmTimes& times) : times_(times) {}

  absl::StatusOr<FarmRun> Run(const plan::JobSpec& spec, std::int32_t frame_count, std::int32_t workers) {
    std::vector<plan::PlannedFrame> frames;
    for (std::int32_t f = 0; f < frame_count; ++f) {
      frames.push_back({.number = f, .blob = base::HashBytes(fmt::format("frame {}", f)), .extension = ".ply"});
    }
    ASSIGN_OR_RETURN(std::vector<plan::PlannedTask> planned, plan::Plan(spec, frames, true));
    run_.tasks = std::ssize(planned);
    Happen(core::Restored{});
    for (std::int32_t w = 0; w < workers; ++w) {
      core::WorkerConnected connected{.connection = static_cast<core::ConnectionId>(w + 1), .worker = fmt::format("worker-{}", w + 1)};
      connected.kinds.assign(std::begin(tasks::kAllKinds), std::end(tasks::kAllKinds));
      Happen(std::move(connected));
      Post(times_.heartbeat, core::Heartbeat{.connection = static_cast<core::ConnectionId>(w + 1)});
    }
    Happen(core::JobSubmitted{.id = "j1", .name = "take", .user = "anna"});
    Happen(core::TasksAdded{.job = "j1", .tasks = std::move(planned), .complete = true, .bad_frames_max = 0});
    Post(kTick, core::Tick{});
    while (core::PhaseOf(state_.jobs[0]) == core::Phase::kRunning && absl::ToDoubleSeconds(now_ - begin_) < kPatienceS) Advance();
    if (core::PhaseOf(state_.jobs[0]) != core::Phase::kDone) {
      return absl::InternalError(fmt::format("the job did not end well: {}", core::Explain(state_, state_.jobs[0])));
    }
    run_.wall_s = absl::ToDoubleSeconds(now_ - begin_);
    return run_;
  }

 private:
  void Post(absl::Duration after, core::Event event) { mail_.push({now_ + after, ++posted_, std::move(event)}); }

  void Advance() {
    Mail mail = mail_.top();
    mail_.pop();
    now_ = mail.at;
    if (std::holds_alternative<core::Tick>(mail.event)) {
      Post(kTick, core::Tick{});
      if (const double left = core::View(state_, state_.jobs[0]).seconds_left; left >= 0) {
        run_.forecasts.emplace_back(absl::ToDoubleSeconds(now_ - begin_), left);
      }
    }
    if (auto* beat = std::get_if<core::Heartbeat>(&mail.event)) {
      Post(times_.heartbeat, core::Heartbeat{.connection = beat->connection});
      if (const auto held = held_.find(beat->connection); held != held_.end()) beat->progress.push_back({.id = held->second});
    }
    if (const auto* finished = std::get_if<core::Finished>(&mail.event)) held_.erase(finished->connection);
    Happen(std::move(mail.event));
  }

  void Happen(core::Event event) {
    core::Effects effects = core::Step(state_, std::move(event), now_);
    for (const core::LookUp& look_up : effects.look_ups) Post(times_.look_up, core::LookUpAnswered{.key = look_up.key});
    for (const core::Message& message : effects.messages) {
      if (const auto* leases = std::get_if<core::Leases>(&message.content)) {
        for (const core::Lease& lease : leases->leases) Work(message.connection, lease);
      }
    }
  }

  /// The time a task takes follows from what it is, not from who runs it or when.
  void Work(core::ConnectionId worker, const core::Lease& lease) {
    const nlohmann::json spec = nlohmann::json::parse(lease.spec_json);
    const auto kind = tasks::KindFromName(spec.at("kind").get<std::string>());
    VOROCAST_CHECK(kind.ok());
    const auto index = static_cast<std::size_t>(*kind);
    const TaskTime& time = times_.of[index];
    base::Random random(times_.seed + Number(base::HashBytes(lease.label)));
    const double mean = time.start_s + time.per_input_s * static_cast<double>(spec.at("inputs").size());
    const double seconds = mean * std::exp(time.spread * random.Gaussian() - 0.5 * time.spread * time.spread);
    const absl::Duration held = absl::Seconds(seconds) + times_.process;
    run_.busy_s += absl::ToDoubleSeconds(held);
    run_.spent_s[index] += absl::ToDoubleSeconds(held);
    const absl::Duration after = held + 2 * times_.message;
    held_[worker] = lease.id;
    run_.ended_s[index] = std::max(run_.ended_s[index], absl::ToDoubleSeconds(now_ + after - begin_));
    Post(after,
         core::Finished{
             .connection = worker, .id = lease.id, .outcome = core::Succeeded{.result = {.sha256 = lease.id.key, .size = 1, .seconds = seconds}}});
  }

  const FarmTimes& times_;
  core::State state_;
  const absl::Time begin_ = absl::UnixEpoch();
  absl::Time now_ = begin_;
  std::int64_t posted_ = 0;
  std::map<core::ConnectionId, core::AttemptId> held_;  // each worker has one slot
  std::priority_queue<Mail, std::vector<Mail>, std::greater<>> mail_;
  FarmRun run_;
};

}  // namespace

absl::StatusOr<FarmRun> RunClockedFarm(const plan::JobSpec& job, std::int32_t frames, std::int32_t workers, const FarmTimes& times) {
  return ClockedFarm(times).Run(job, frames, workers);
}

}  // namespace vorocast::scenario
