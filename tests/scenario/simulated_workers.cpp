// SPDX-License-Identifier: AGPL-3.0-or-later
// Workers: they connect, take attempts, report, hang, fall ill and die.
#include <algorithm>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "tests/scenario/simulated_farm.h"

namespace vorocast::scenario {
namespace {

constexpr absl::Duration kHeartbeat = absl::Seconds(2);

}  // namespace

void SimulatedFarm::Break(core::ConnectionId connection) {
  to_worker_.erase(connection);
  // What was on its way is lost with the stream; that it broke is noticed at once.
  to_scheduler_[connection].clear();
  to_scheduler_[connection].push_back({now_ + Delay(), core::WorkerDisconnected{connection}});
  for (SimulatedWorker& worker : workers_) {
    if (worker.connection != connection) continue;
    worker.connection = 0;
    worker.welcomed = false;
    worker.connects_at = now_ + absl::Milliseconds(static_cast<std::int64_t>(random_.Below(3000)));
  }
}

void SimulatedFarm::Post(core::ConnectionId connection, core::Event event) {
  if (connection == 0) return;
  if (!calm_ && Chance(weather_.message_lost)) return Break(connection);
  auto& stream = to_scheduler_[connection];
  const absl::Time after = stream.empty() ? now_ : stream.back().at;
  stream.push_back({std::max(after, now_ + Delay()), std::move(event)});
}

void SimulatedFarm::Connect(SimulatedWorker& worker) {
  worker.connection = ++last_connection_;
  // Somebody may still know the old address.
  if (replaced_ && Chance(0.2)) to_replaced_.insert(worker.connection);
  worker.beats_at = now_ + kHeartbeat;
  to_worker_[worker.connection];
  core::WorkerConnected hello{.connection = worker.connection, .worker = worker.name, .kinds = worker.kinds, .slots = worker.slots};
  for (const auto& [id, attempt] : worker.held) hello.holding.push_back(id);
  Post(worker.connection, std::move(hello));
}

void SimulatedFarm::StartAttempt(SimulatedWorker& worker, const core::Lease& lease) {
  Attempt attempt{.id = lease.id, .spec_json = lease.spec_json};
  attempt.ends = now_ + absl::Milliseconds(static_cast<std::int64_t>(random_.Below(4000)));
  if (!calm_ && Chance(weather_.attempt_drags)) attempt.ends += absl::Seconds(static_cast<std::int64_t>(random_.Below(120)));
  if (worker.sick_until > now_) attempt.ends = now_ + absl::Milliseconds(20);
  worker.held.emplace(lease.id, std::move(attempt));
}

core::Finished SimulatedFarm::Outcome(const SimulatedWorker& worker, const Attempt& attempt) {
  core::Finished finished{.connection = worker.connection, .id = attempt.id};
  const auto spec = nlohmann::json::parse(attempt.spec_json);
  const bool is_bad = spec["kind"] == "tessellate" && bad_frames_.contains(spec["inputs"][0]["frame"].get<std::int32_t>());
  if (is_bad) {
    finished.outcome = core::AttemptFailed{core::Cause::kInput, "normals are not finite"};
  } else if (now_ < worker.sick_until && !calm_) {
    finished.outcome = core::AttemptFailed{core::Cause::kInternal, "the worker is ill"};
  } else if (!calm_ && Chance(weather_.attempt_fails)) {
    constexpr core::Cause kCauses[] = {core::Cause::kCrashed, core::Cause::kOutOfMemory, core::Cause::kTimedOut,
                                       core::Cause::kStore,   core::Cause::kInternal,    core::Cause::kDrained};
    finished.outcome = core::AttemptFailed{kCauses[random_.Below(std::size(kCauses))], "bad luck"};
  } else {
    finished.outcome = core::Succeeded{{.sha256 = attempt.id.key, .size = 1, .seconds = 1}};
  }
  return finished;
}

void SimulatedFarm::MoveWorker(SimulatedWorker& worker) {
  if (now_ < worker.silent_until) return;
  if (!calm_) {
    if (Chance(weather_.worker_hangs)) worker.silent_until = now_ + absl::Seconds(static_cast<std::int64_t>(random_.Below(30)));
    if (worker.connection != 0 && Chance(weather_.stream_breaks)) Break(worker.connection);
    if (Chance(weather_.worker_sickens)) worker.sick_until = now_ + absl::Seconds(static_cast<std::int64_t>(random_.Below(60)));
    if (Chance(weather_.worker_dies)) {
      if (worker.connection != 0) Break(worker.connection);
      worker.held.clear();
      worker.sick_until = absl::InfinitePast();
      worker.name = fmt::format("worker-{}", ++last_worker_);
      return;
    }
  }
  if (worker.connection == 0 && now_ >= worker.connects_at) Connect(worker);
  for (auto& [id, attempt] : worker.held) {
    if (attempt.report || now_ < attempt.ends) continue;
    attempt.report = Outcome(worker, attempt);
    if (std::holds_alternative<core::Succeeded>(attempt.report->outcome)) files_.insert(id.key);
    if (!worker.welcomed) continue;  // told after the welcome
    const core::ConnectionId connection = worker.connection;
    Post(connection, *attempt.report);
    if (!calm_ && Chance(weather_.message_doubled)) Post(worker.connection, *attempt.report);
  }
  if (worker.welcomed && now_ >= worker.beats_at) {
    worker.beats_at = now_ + kHeartbeat;
    core::Heartbeat beat{.connection = worker.connection};
    for (const auto& [id, attempt] : worker.held) {
      if (!attempt.report) beat.progress.push_back({id, 0.5});
    }
    Post(worker.connection, std::move(beat));
  }
}

void SimulatedFarm::Receive(const core::Message& message) {
  const auto found = std::find_if(workers_.begin(), workers_.end(), [&](const SimulatedWorker& w) { return w.connection == message.connection; });
  if (found == workers_.end()) return;
  SimulatedWorker& worker = *found;
  const auto drop = [&worker](const std::vector<core::AttemptId>& ids) {
    for (const core::AttemptId& id : ids) worker.held.erase(id);
  };
  if (const auto* welcome = std::get_if<core::Welcome>(&message.content)) {
    worker.welcomed = true;
    drop(welcome->drop);
    for (auto& [id, attempt] : worker.held) {
      if (!attempt.report) continue;
      attempt.report->connection = worker.connection;
      Post(worker.connection, *attempt.report);
    }
  }
  if (const auto* leases = std::get_if<core::Leases>(&message.content)) {
    for (const core::Lease& lease : leases->leases) StartAttempt(worker, lease);
  }
  if (const auto* acknowledged = std::get_if<core::Acknowledge>(&message.content)) drop(acknowledged->ids);
  if (const auto* revoke = std::get_if<core::Revoke>(&message.content)) drop(revoke->ids);
}

}  // namespace vorocast::scenario
