// SPDX-License-Identifier: AGPL-3.0-or-later
#include "scheduler/fleet/slurm_fleet.h"

#include <sys/stat.h>

#include <algorithm>
#include <cmath>
#include <fstream>

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include "absl/time/clock.h"
#include "scheduler/fleet/command.h"
#include "services/base/digest.h"

namespace vorocast::fleet {
namespace {

/// Its arguments are the worker's command line. A worker that Slurm starts again is another process and needs another name.
constexpr char kScript[] =
    "#!/bin/sh\n"
    "# Written by vorocast-scheduler. Becomes the worker, so that Slurm's signals reach it and its exit code reaches Slurm.\n"
    "exec \"$@\" --name \"slurm-${SLURM_ARRAY_JOB_ID:-0}_${SLURM_ARRAY_TASK_ID:-0}-${SLURM_RESTART_COUNT:-0}\"\n";

/// From the last task given back to the worker's end.
constexpr double kEndMarginSeconds = 5;
/// Members named in one call of scancel.
constexpr std::size_t kNamedAtOnce = 200;

std::filesystem::path ScriptPath(const std::filesystem::path& state) { return state / "slurm" / "worker.sh"; }

bool HasWork(const Demand& demand) {
  return std::any_of(demand.kinds.begin(), demand.kinds.end(), [](const KindDemand& k) { return k.ready + k.running + k.blocked > 0; });
}

bool AnyConnected(const std::vector<std::string>& workers) {
  return std::any_of(workers.begin(), workers.end(), [](const std::string& name) { return name.starts_with("slurm-"); });
}

}  // namespace

std::string SlurmJobName(const std::filesystem::path& state) {
  return fmt::format("vorocast-{}", base::HashBytes(state.lexically_normal().string()).Hex().substr(0, 10));
}

std::string WorkerNamePrefix(const SlurmMember& member) { return fmt::format("slurm-{}-", Name(member)); }

SlurmFleet::SlurmFleet(SlurmFleetOptions options)
    : options_(std::move(options)), job_name_(SlurmJobName(options_.state)), ask_pause_(options_.poll), counts_("not seen yet") {}

absl::StatusOr<std::unique_ptr<SlurmFleet>> SlurmFleet::Start(SlurmFleetOptions options) {
  if (!options.run) options.run = [](const std::vector<std::string>& arguments) { return RunCommand(arguments); };
  std::unique_ptr<SlurmFleet> fleet(new SlurmFleet(std::move(options)));
  RETURN_IF_ERROR(fleet->WriteScript());
  spdlog::info("slurm fleet: job_name={} partition=\"{}\" workers_max={}", fleet->job_name_, fleet->options_.partition,
               fleet->options_.limits.workers_max);
  fleet->thread_ = std::thread([raw = fleet.get()] { raw->Watch(); });
  return fleet;
}

SlurmFleet::~SlurmFleet() {
  {
    const std::lock_guard lock(mutex_);
    stopping_ = true;
  }
  wake_.notify_all();
  if (!thread_.joinable()) return;
  thread_.join();
  spdlog::info("slurm fleet: its workers stay for the next scheduler and leave by themselves after {}; at once: scancel --name={}",
               absl::FormatDuration(options_.leave_after), job_name_);
}

absl::Status SlurmFleet::WriteScript() const {
  const std::filesystem::path path = ScriptPath(options_.state);
  std::error_code error;
  std::filesystem::create_directories(path.parent_path(), error);
  std::filesystem::create_directories(options_.state / "logs", error);
  std::ofstream file(path);
  file << kScript;
  file.close();
  if (!file || chmod(path.c_str(), 0755) != 0) return absl::UnavailableError(fmt::format("{}: cannot be written", path.string()));
  return absl::OkStatus();
}

std::string SlurmFleet::Describe() const {
  const std::lock_guard lock(mutex_);
  return trouble_.empty() ? fmt::format("Slurm: {}", counts_) : fmt::format("Slurm: {}; last seen: {}", trouble_, counts_);
}

void SlurmFleet::Watch() {
  absl::Duration pause = options_.poll;
  std::unique_lock lock(mutex_);
  while (!stopping_) {
    lock.unlock();
    const absl::Status status = Round();
    pause = status.ok() ? options_.poll : std::min(2 * pause, options_.pause_max);
    Note(status, pause);
    WriteStatus();
    lock.lock();
    wake_.wait_for(lock, absl::ToChronoMilliseconds(pause), [this] { return stopping_; });
  }
}

void SlurmFleet::Note(const absl::Status& status, absl::Duration pause) {
  const std::lock_guard lock(mutex_);
  if (status.ok()) {
    if (!trouble_.empty()) spdlog::info("slurm fleet: goes on: {}", counts_);
    trouble_.clear();
    return;
  }
  trouble_ = fmt::format("{}; tries again every {}", std::string(status.message()), absl::FormatDuration(pause));
  // The pauses grow, so that these lines stay few.
  spdlog::warn("slurm fleet: {}", trouble_);
}

void SlurmFleet::WriteStatus() {
  const std::string text = Describe();
  if (text == written_) return;
  const std::filesystem::path path = options_.state / "slurm" / "status.txt";
  const std::filesystem::path temporary = options_.state / "slurm" / "status.txt.new";
  std::ofstream file(temporary);
  file << text << "\n";
  file.close();
  std::error_code error;
  std::filesystem::rename(temporary, path, error);
  // A full disk is told of by others; the next round tries again.
  if (file && !error) written_ = text;
}

absl::Status SlurmFleet::Round() {
  ASSIGN_OR_RETURN(const Demand demand, options_.demand());
  ASSIGN_OR_RETURN(const std::string printed, Run({"squeue", "--json"}));
  ASSIGN_OR_RETURN(const std::vector<SlurmMember> members, ParseQueue(printed, job_name_));
  std::vector<SlurmMember> queued, up;
  for (const SlurmMember& member : members) {
    if (member.state == SlurmMember::State::kQueued) queued.push_back(member);
    if (member.state == SlurmMember::State::kUp) up.push_back(member);
  }
  {
    const std::lock_guard lock(mutex_);
    counts_ = fmt::format("{} workers up, {} queued, at most {}", up.size(), queued.size(), options_.limits.workers_max);
  }
  if (AnyConnected(demand.idle_workers) || AnyConnected(demand.busy_workers)) {
    waiting_for_first_ = false;
    ask_pause_ = options_.poll;
  }

  const absl::Time now = absl::Now();
  const SizingDecision decision = Size({.demand = demand,
                                        .workers_up = static_cast<std::int32_t>(up.size()),
                                        .workers_queued = static_cast<std::int32_t>(queued.size()),
                                        .seconds_left = SecondsLeft(demand, now),
                                        .seconds_with_surplus = surplus_since_ ? absl::ToDoubleSeconds(now - *surplus_since_) : 0},
                                       options_.limits);
  if (!decision.surplus) surplus_since_.reset();
  if (decision.surplus && !surplus_since_) surplus_since_ = now;
  if (decision.withdraw > 0) RETURN_IF_ERROR(Withdraw(std::move(queued), decision.withdraw));
  if (decision.drain > 0) RETURN_IF_ERROR(Drain(up, demand, decision.drain));
  if (decision.ask > 0 && now >= next_ask_) return Ask(decision.ask);
  return absl::OkStatus();
}

double SlurmFleet::SecondsLeft(const Demand& demand, absl::Time now) {
  if (!HasWork(demand)) deadline_.reset();
  if (!deadline_) deadline_ = now + options_.finish_in;
  return absl::ToDoubleSeconds(*deadline_ - now);
}

absl::Status SlurmFleet::Ask(std::int32_t workers) {
  // Workers that end as soon as they start, or never find their way here, are asked for more and more rarely.
  if (waiting_for_first_) ask_pause_ = std::min(2 * ask_pause_, options_.pause_max);
  waiting_for_first_ = true;
  next_ask_ = absl::Now() + ask_pause_;
  const SizingLimits& limits = options_.limits;
  std::vector<std::string> arguments = {
      "sbatch", "--parsable", "--requeue", fmt::format("--job-name={}", job_name_), fmt::format("--array=1-{}", workers), "--ntasks=1",
      fmt::format("--cpus-per-task={}", limits.slots), fmt::format("--chdir={}", options_.state.string()),
      fmt::format("--output={}", (options_.state / "logs" / "slurm-%A_%a.log").string()), "--open-mode=append",
      // Before a time limit or a preemption. Without "B:" only srun's steps are told, and there are none.
      fmt::format("--signal=B:TERM@{:.0f}", std::ceil(absl::ToDoubleSeconds(options_.drain_time)) + kEndMarginSeconds)};
  if (!options_.partition.empty()) arguments.push_back(fmt::format("--partition={}", options_.partition));
  arguments.insert(arguments.end(), options_.extra.begin(), options_.extra.end());
  for (const std::string& word :
       {ScriptPath(options_.state).string(), options_.worker.string(), std::string("--scheduler"), options_.scheduler, std::string("--slots"),
        std::to_string(limits.slots), std::string("--drain-time"), fmt::format("{:g}", absl::ToDoubleSeconds(options_.drain_time)),
        std::string("--leave-after"), fmt::format("{:g}", absl::ToDoubleSeconds(options_.leave_after))}) {
    arguments.push_back(word);
  }
  arguments.insert(arguments.end(), options_.worker_extra.begin(), options_.worker_extra.end());
  ASSIGN_OR_RETURN(const std::string printed, Run(arguments));
  ASSIGN_OR_RETURN(const std::int64_t job, ParseSubmitted(printed));
  spdlog::info("slurm fleet: asked for workers: count={} job={}", workers, job);
  return absl::OkStatus();
}

absl::Status SlurmFleet::Withdraw(std::vector<SlurmMember> queued, std::int32_t count) {
  // The youngest first: the others have waited longer.
  std::reverse(queued.begin(), queued.end());
  queued.resize(std::min({queued.size(), static_cast<std::size_t>(count), kNamedAtOnce}));
  std::vector<std::string> arguments = {"scancel", "--state=PENDING"};
  for (const SlurmMember& member : queued) arguments.push_back(Name(member));
  spdlog::info("slurm fleet: withdraws queued workers: count={}", queued.size());
  return Run(arguments).status();
}

absl::Status SlurmFleet::Drain(const std::vector<SlurmMember>& up, const Demand& demand, std::int32_t count) {
  // Only those that hold nothing. A busy one is drained in a later round, when it has no task any more.
  std::vector<std::string> arguments = {"scancel", "--signal=TERM", "--batch"};
  const std::size_t options = arguments.size();
  for (auto member = up.rbegin(); member != up.rend(); ++member) {
    if (arguments.size() - options == std::min(static_cast<std::size_t>(count), kNamedAtOnce)) break;
    const std::string prefix = WorkerNamePrefix(*member);
    const bool idle =
        std::any_of(demand.idle_workers.begin(), demand.idle_workers.end(), [&](const std::string& name) { return name.starts_with(prefix); });
    if (idle) arguments.push_back(Name(*member));
  }
  if (arguments.size() == options) return absl::OkStatus();
  spdlog::info("slurm fleet: drains idle workers: count={}", arguments.size() - options);
  return Run(arguments).status();
}

}  // namespace vorocast::fleet
