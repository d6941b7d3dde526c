// SPDX-License-Identifier: AGPL-3.0-or-later
#include "scheduler/fleet/local_fleet.h"

#include <signal.h>

#include <algorithm>
#include <fstream>
#include <map>

#include <fmt/format.h>
#include <spdlog/spdlog.h>
#include <nlohmann/json.hpp>

#include "absl/time/clock.h"

namespace vorocast::fleet {
namespace {

constexpr absl::Duration kSoon = absl::Seconds(10);  // a member that ends earlier than this is held back
constexpr int kDoublingsMax = 5;                     // at most half a minute

struct Recorded {
  ProcessId process;
  std::vector<std::string> arguments;
};

/// Seconds after which a member whose scheduler was killed, and never started again, ends by itself.
constexpr char kLeaveAfter[] = "60";

std::map<std::string, Recorded> ReadFile(const std::filesystem::path& path) {
  std::map<std::string, Recorded> members;
  std::ifstream file(path);
  if (!file) return members;
  try {
    for (const auto& member : nlohmann::json::parse(file)) {
      members[member.at("name")] = {.process = {.pid = member.at("pid"), .start_time = member.at("start_time")}, .arguments = member.at("arguments")};
    }
  } catch (const nlohmann::json::exception& error) {
    spdlog::warn("fleet.json cannot be read and is passed over: error=\"{}\"", error.what());
    members.clear();
  }
  return members;
}

}  // namespace

std::vector<Member> Members(const LocalFleetPlan& plan) {
  std::vector<Member> members;
  for (std::int32_t i = 1; i <= plan.workers; ++i) {
    members.push_back({fmt::format("worker-{}", i),
                       {(plan.programs / "vorocast-worker").string(), "--scheduler", plan.scheduler, "--leave-after", kLeaveAfter, "--slots", "1"}});
  }
  if (plan.simulation)
    members.push_back(
        {"simulation", {(plan.programs / "vorocast-simulation").string(), "--scheduler", plan.scheduler, "--leave-after", kLeaveAfter}});
  return members;
}

absl::StatusOr<std::unique_ptr<LocalFleet>> LocalFleet::Start(FleetOptions options) {
  std::error_code error;
  std::filesystem::create_directories(options.state / "logs", error);
  if (error) return absl::UnavailableError(fmt::format("{}: cannot be created: {}", (options.state / "logs").string(), error.message()));
  std::unique_ptr<LocalFleet> fleet(new LocalFleet(std::move(options)));
  for (const Member& member : fleet->options_.members) fleet->kept_.push_back({.member = member});
  fleet->Adopt();
  for (Kept& kept : fleet->kept_) {
    if (kept.process.pid > 0) continue;
    if (const absl::Status status = fleet->Launch(kept); !status.ok()) return status;
  }
  if (const absl::Status status = fleet->WriteFile(); !status.ok()) return status;
  fleet->thread_ = std::thread([raw = fleet.get()] { raw->Watch(); });
  return fleet;
}

LocalFleet::~LocalFleet() {
  {
    const std::lock_guard lock(mutex_);
    stopping_ = true;
  }
  wake_.notify_all();
  if (thread_.joinable()) thread_.join();
  StopMembers();
}

std::string LocalFleet::Describe() const {
  const std::lock_guard lock(mutex_);
  const auto running = std::count_if(kept_.begin(), kept_.end(), [](const Kept& kept) { return kept.process.pid > 0; });
  return fmt::format("this machine: {} of {} processes run", running, kept_.size());
}

void LocalFleet::Adopt() {
  for (auto& [name, recorded] : ReadFile(options_.state / "fleet.json")) {
    if (!IsAlive(recorded.process)) continue;
    const auto kept = std::find_if(kept_.begin(), kept_.end(), [&](const Kept& k) { return k.member.name == name; });
    if (kept != kept_.end() && kept->member.arguments == recorded.arguments) {
      kept->process = recorded.process;
      kept->started = absl::Now();
      ++adopted_;
      spdlog::info("fleet member taken up: name={} pid={}", name, recorded.process.pid);
    } else {
      // A larger fleet of before, or one that connects elsewhere: it may finish what it holds.
      Signal(recorded.process, SIGTERM);
      old_.push_back(recorded.process);
    }
  }
}

absl::Status LocalFleet::Launch(Kept& kept) {
  ASSIGN_OR_RETURN(kept.process, StartProcess(kept.member.arguments, options_.state / "logs" / (kept.member.name + ".log")));
  kept.started = absl::Now();
  spdlog::info("fleet member started: name={} pid={}", kept.member.name, kept.process.pid);
  return absl::OkStatus();
}

absl::Status LocalFleet::WriteFile() const {
  nlohmann::json members = nlohmann::json::array();
  for (const Kept& kept : kept_) {
    members.push_back(
        {{"name", kept.member.name}, {"pid", kept.process.pid}, {"start_time", kept.process.start_time}, {"arguments", kept.member.arguments}});
  }
  const std::filesystem::path path = options_.state / "fleet.json";
  const std::filesystem::path temporary = options_.state / "fleet.json.new";
  {
    std::ofstream file(temporary);
    file << members.dump(2) << "\n";
    if (!file) return absl::UnavailableError(fmt::format("{}: cannot be written", temporary.string()));
  }
  std::error_code error;
  std::filesystem::rename(temporary, path, error);
  if (error) return absl::UnavailableError(fmt::format("{}: cannot be written: {}", path.string(), error.message()));
  return absl::OkStatus();
}

void LocalFleet::Restart(Kept& kept) {
  const absl::Time now = absl::Now();
  if (kept.process.pid > 0) {
    kept.quick_deaths = now - kept.started < kSoon ? std::min(kept.quick_deaths + 1, kDoublingsMax) : 0;
    kept.next_start = now + (kept.quick_deaths == 0 ? absl::ZeroDuration() : absl::Milliseconds(500) * (1 << kept.quick_deaths));
    spdlog::warn("fleet member ended: name={} pid={} restart_in={}", kept.member.name, kept.process.pid, absl::FormatDuration(kept.next_start - now));
    kept.process = ProcessId{};
  }
  if (now < kept.next_start) return;
  absl::Status status = Launch(kept);
  if (status.ok()) status = WriteFile();
  if (status.ok()) return;
  spdlog::error("fleet member cannot be started: name={} error=\"{}\"", kept.member.name, std::string(status.message()));
  kept.next_start = now + kSoon;
}

void LocalFleet::Watch() {
  std::unique_lock lock(mutex_);
  while (!stopping_) {
    for (Kept& kept : kept_) {
      if (!IsAlive(kept.process)) Restart(kept);
    }
    wake_.wait_for(lock, absl::ToChronoMilliseconds(options_.poll), [this] { return stopping_; });
  }
}

void LocalFleet::StopMembers() {
  std::vector<ProcessId> running = old_;
  for (const Kept& kept : kept_) running.push_back(kept.process);
  for (const ProcessId& process : running) Signal(process, SIGTERM);
  const absl::Time deadline = absl::Now() + options_.stop_grace;
  while (absl::Now() < deadline && std::any_of(running.begin(), running.end(), [](const ProcessId& p) { return IsAlive(p); })) {
    absl::SleepFor(absl::Milliseconds(20));
  }
  for (const ProcessId& process : running) Signal(process, SIGKILL);
  for (Kept& kept : kept_) kept.process = ProcessId{};
  if (const absl::Status status = WriteFile(); !status.ok()) spdlog::error("{}", std::string(status.message()));
}

}  // namespace vorocast::fleet
