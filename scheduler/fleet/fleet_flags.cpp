// SPDX-License-Identifier: AGPL-3.0-or-later
#include "scheduler/fleet/fleet_flags.h"

#include <unistd.h>

#include <algorithm>
#include <utility>

#include <spdlog/spdlog.h>

#include "scheduler/fleet/local_fleet.h"
#include "scheduler/fleet/slurm_fleet.h"

namespace vorocast::fleet {
namespace {

constexpr char kSlurm[] = "Workers on a Slurm cluster (--fleet slurm)";

std::filesystem::path Programs() {
  std::error_code error;
  return std::filesystem::read_symlink("/proc/self/exe", error).parent_path();
}

std::string HostName() {
  char host[256] = {};
  return gethostname(host, sizeof(host) - 1) == 0 ? host : "localhost";
}

}  // namespace

std::string AddressForOthers(const std::string& address, const std::string& host) {
  const std::size_t colon = address.rfind(':');
  const std::string name = address.substr(0, colon);
  return name == "0.0.0.0" || name == "[::]" || name == "::" || name == "*" ? host + address.substr(colon) : address;
}

void FleetFlags::AddTo(CLI::App& program) {
  program.add_option("--workers", workers_, "Workers to run on this machine")->check(CLI::Range(0, 1024));
  program.add_flag("--simulation", simulation_, "Run a simulation service on this machine too");
  program.add_option("--fleet", kind_, "Where workers come from: local (those of --workers only) or slurm")
      ->check(CLI::IsMember({"local", "slurm"}))
      ->capture_default_str();
  const auto slurm = [&](CLI::Option* option) { return option->group(kSlurm)->capture_default_str(); };
  slurm(program.add_option("--slurm-partition", partition_, "Partition to ask for workers in (Slurm's default one)"));
  slurm(program.add_option("--workers-max", limits_.workers_max, "Never more workers than this"))->check(CLI::Range(1, 100000));
  slurm(program.add_option("--workers-min", limits_.workers_min, "Kept also when there is no work"))->check(CLI::Range(0, 100000));
  slurm(program.add_option("--queued-max", limits_.queued_max, "Workers that may wait in Slurm's queue at once"))->check(CLI::Range(1, 1000));
  slurm(program.add_option("--slots", limits_.slots, "Tasks at once, and processors, of a worker"))->check(CLI::Range(1, 4096));
  slurm(program.add_option("--finish-in", finish_in_s_, "Seconds in which work that begins now should be done: as many workers as that takes"))
      ->check(CLI::Range(1.0, 1e7));
  slurm(program.add_option("--idle", limits_.surplus_seconds, "Seconds that workers with nothing to do are kept"))->check(CLI::Range(0.0, 1e7));
  slurm(program.add_option("--advertise", advertise_,
                           "What workers connect to, HOST:PORT; A,B where one stands by (--listen with this machine's name)"));
  slurm(program.add_option("--slurm-worker", worker_, "vorocast-worker's path on the cluster's machines (the one beside this program)"));
  program.add_option("--slurm-option", extra_, "One more argument for sbatch, as in --slurm-option=--account=film; may be given again")
      ->allow_extra_args(false)
      ->group(kSlurm);
  program
      .add_option("--slurm-worker-option", worker_extra_,
                  "One more argument for vorocast-worker, as in --slurm-worker-option=--token-file=/farm/worker.token; may be given again")
      ->allow_extra_args(false)
      ->group(kSlurm);
  slurm(program.add_option("--drain-time", drain_s_, "Seconds that tasks get to end when a worker is told to leave; less than Slurm's KillWait"))
      ->check(CLI::Range(0.0, 86400.0));
  slurm(program.add_option("--leave-after", leave_after_s_, "Seconds after which workers without a scheduler end"))->check(CLI::Range(1.0, 1e7));
  slurm(program.add_option("--slurm-poll", poll_s_, "Seconds between looks at Slurm's queue"))->check(CLI::Range(0.1, 3600.0));
}

absl::Status FleetFlags::Validate(const std::string& listen) const {
  if (kind_ != "slurm") return absl::OkStatus();
  if (advertise_.empty() && (listen.empty() || listen.starts_with("unix:"))) {
    return absl::InvalidArgumentError("--fleet slurm needs --listen HOST:PORT: the cluster's machines cannot reach a socket in a folder");
  }
  if (limits_.workers_min > limits_.workers_max) return absl::InvalidArgumentError("--workers-min is more than --workers-max");
  for (const std::string& option : extra_) {
    if (!option.starts_with("-")) return absl::InvalidArgumentError("--slurm-option takes what sbatch takes: --slurm-option=--account=film");
  }
  for (const std::string& option : worker_extra_) {
    if (!option.starts_with("-"))
      return absl::InvalidArgumentError("--slurm-worker-option takes what vorocast-worker takes: --slurm-worker-option=--tls-ca=/farm/ca.pem");
  }
  return absl::OkStatus();
}

absl::StatusOr<std::vector<std::unique_ptr<Fleet>>> FleetFlags::Start(const std::filesystem::path& state, const SchedulerAddresses& addresses,
                                                                      std::function<absl::StatusOr<Demand>()> demand) const {
  std::vector<std::unique_ptr<Fleet>> fleets;
  if (workers_ > 0 || simulation_) {
    FleetOptions options{.state = state,
                         .members = Members({.programs = Programs(), .scheduler = addresses.here, .workers = workers_, .simulation = simulation_})};
    ASSIGN_OR_RETURN(fleets.emplace_back(), LocalFleet::Start(std::move(options)));
  }
  if (kind_ == "slurm") {
    ASSIGN_OR_RETURN(fleets.emplace_back(), StartSlurm(state, addresses.elsewhere, std::move(demand)));
  }
  for (const auto& fleet : fleets) spdlog::info("fleet: {}", fleet->Describe());
  return fleets;
}

absl::StatusOr<std::unique_ptr<Fleet>> FleetFlags::StartSlurm(const std::filesystem::path& state, const std::string& address,
                                                              std::function<absl::StatusOr<Demand>()> demand) const {
  SlurmFleetOptions options{.state = state,
                            .scheduler = advertise_.empty() ? AddressForOthers(address, HostName()) : advertise_,
                            .worker = worker_.empty() ? Programs() / "vorocast-worker" : std::filesystem::path(worker_),
                            .partition = partition_,
                            .extra = extra_,
                            .worker_extra = worker_extra_,
                            .limits = limits_};
  options.limits.seconds_left_floor = std::min(options.limits.seconds_left_floor, finish_in_s_);
  options.finish_in = absl::Seconds(finish_in_s_);
  options.poll = absl::Seconds(poll_s_);
  options.drain_time = absl::Seconds(drain_s_);
  options.leave_after = absl::Seconds(leave_after_s_);
  options.demand = std::move(demand);
  ASSIGN_OR_RETURN(std::unique_ptr<SlurmFleet> fleet, SlurmFleet::Start(std::move(options)));
  return fleet;
}

}  // namespace vorocast::fleet
