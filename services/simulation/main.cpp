// SPDX-License-Identifier: AGPL-3.0-or-later
// vorocast-simulation: runs effects on tracked takes, as the last stage of the scheduler's jobs and through a gRPC door of its own.
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <future>
#include <iostream>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include <fmt/format.h>
#include "services/base/processor.h"
#include "services/lease/drain_signals.h"
#include "services/lease/lease_flags.h"
#include "services/lease/lease_loop.h"
#include "services/lease/lease_metrics.h"
#include "services/rpc/security_flags.h"
#include "services/rpc/server.h"
#include "services/simulation/live_command.h"
#include "services/simulation/simulate_executor.h"
#include "services/simulation/simulation_service.h"
#include "services/simulation/try_effect.h"
#include "services/telemetry/telemetry_flags.h"

namespace {

using namespace vorocast;

constexpr char kStory[] =
    "Runs effects on tracked takes with rigid-body physics. With --scheduler it takes simulation tasks from a Vorocast scheduler;\n"
    "with --listen it answers its own gRPC service: which effects there are, whether an effect is right, and a run on any tracked\n"
    "take in the artifact folder given by --store, at once or live. Both at once are fine. SIGTERM or Ctrl-C lets it finish what runs and leave.";

struct Options {
  lease::LeaseLoopOptions lease;
  telemetry::TelemetryFlags telemetry;
  std::string listen;
  std::string store;
  rpc::ServerSecurity security;
  std::int32_t live_max = 4;
  double live_idle_s = 600;
};

/// Until SIGTERM or SIGINT.
void WaitForSignal() {
  std::promise<void> told;
  std::future<void> signalled = told.get_future();
  bool first = true;
  const lease::DrainSignals signals([&] {
    if (std::exchange(first, false)) told.set_value();
  });
  signalled.wait();
}

absl::Status Serve(Options& options) {
  RETURN_IF_ERROR(options.telemetry.StartLog("simulation"));
  lease::LeaseMetrics metrics("simulation", options.lease.slots);
  ASSIGN_OR_RETURN(const auto metrics_server, options.telemetry.StartMetrics(metrics.registry()));
  options.lease.metrics = &metrics;
  std::unique_ptr<simulation::SimulationService> service;
  std::unique_ptr<rpc::Server> server;
  if (!options.listen.empty()) {
    ASSIGN_OR_RETURN(storage::ArtifactStore store, storage::ArtifactStore::Open(options.store));
    service =
        std::make_unique<simulation::SimulationService>(simulation::SimulationService::Options{.store = std::move(store),
                                                                                               .program = options.lease.program,
                                                                                               .runs_max = options.lease.slots,
                                                                                               .live_max = options.live_max,
                                                                                               .live_idle = absl::Seconds(options.live_idle_s)});
    const auto log = [](const std::string& text) { fmt::print(stderr, "vorocast-simulation: {}\n", text); };
    ASSIGN_OR_RETURN(const rpc::ServerGuard guard, rpc::OpenGuard(options.security, log));
    if (rpc::IsUnguarded(options.listen, guard)) {
      log(fmt::format("whoever reaches {} may run simulations: it asks for neither tokens nor client certificates", options.listen));
    }
    ASSIGN_OR_RETURN(server, rpc::StartServer({.listen = options.listen, .services = {service.get()}, .guard = guard}));
    fmt::print("{}\n", server->address());
    std::fflush(stdout);
  }
  absl::Status status = absl::OkStatus();
  if (options.lease.scheduler.empty()) {
    WaitForSignal();
  } else {
    status = lease::RunLeaseLoop(options.lease, {tasks::Kind::kSimulate});
  }
  if (server) server->Stop(options.lease.drain_time);
  return status;
}

}  // namespace

int main(int argc, char** argv) {
  base::RequireProcessor();
  CLI::App app(kStory, "vorocast-simulation");
  Options options;
  app.add_option("--scheduler", options.lease.scheduler, "Takes tasks from here: HOST:PORT or unix:/PATH; A,B where one stands by")
      ->envname("VOROCAST_SCHEDULER");
  CLI::Option* listen =
      app.add_option("--listen", options.listen, "Answers gRPC here: HOST:PORT, port 0 for any free one, or unix:/PATH. The address is printed");
  CLI::Option* store = app.add_option("--store", options.store, "The artifact folder for runs asked for over --listen");
  listen->needs(store);
  rpc::AddServerSecurityFlags(app, options.security);
  app.add_option("--live-max", options.live_max, "Live sessions at once, over --listen; each may keep a processor busy")
      ->check(CLI::Range(0, 1000))
      ->capture_default_str();
  app.add_option("--live-idle", options.live_idle_s, "Seconds after which a live session of which nothing is heard is ended")
      ->check(CLI::Range(1.0, 1e6))
      ->capture_default_str();
  lease::LeaseFlags flags;
  flags.AddTo(app, options.lease, "Simulations at once, from each side");
  options.telemetry.AddTo(app);
  CLI::App* execute_task = app.add_subcommand("execute-task", "Runs one task given on standard input; the program starts this itself");
  CLI::App* try_effect = app.add_subcommand("try", "Runs one effect on a tracked.h5 at once, without a scheduler");
  simulation::TryOptions trial;
  try_effect->add_option("tracked", trial.tracked, "The tracked take")->required()->check(CLI::ExistingFile);
  try_effect->add_option("--effect", trial.effect, "A shipped effect's name or a JSON file (docs/effects.md)")->required();
  try_effect->add_option("--onto", trial.onto, "The second tracked.h5, which a morph turns the first into")->check(CLI::ExistingFile);
  try_effect->add_option("--out", trial.out, "Writes simulated.h5 here");
  try_effect->add_option("--sheet", trial.sheet, "Writes a contact sheet (PNG) here");
  try_effect->add_option("--pictures", trial.pictures, "On the sheet")->check(CLI::Range(1, 200))->capture_default_str();
  try_effect->add_option("--from", trial.from_s, "Time of the sheet's first picture, seconds")->capture_default_str();
  try_effect->add_option("--width", trial.width, "Of a picture, pixels")->check(CLI::Range(16, 4096))->capture_default_str();
  CLI::App* live_command = app.add_subcommand("live", "Plays an effect on a tracked.h5 while its fields are changed: 'help' lists the commands");
  simulation::LiveOptions live;
  live_command->add_option("tracked", live.tracked, "The tracked take")->required()->check(CLI::ExistingFile);
  live_command->add_option("--effect", live.effect, "A shipped effect's name or a JSON file (docs/effects.md)")->required();
  live_command->add_option("--at", live.at, "A simulation service that has the take in its artifact folder: HOST:PORT or unix:/PATH (this program)");
  rpc::ClientSecurityFlags live_security;
  live_security.AddTo(*live_command);
  CLI11_PARSE(app, argc, argv);

  if (execute_task->parsed()) {
    std::vector<std::unique_ptr<lease::Executor>> executors;
    executors.push_back(std::make_unique<simulation::SimulateExecutor>());
    return lease::ExecuteTaskMain(executors);
  }
  if (try_effect->parsed()) {
    const absl::Status status = simulation::TryEffect(trial);
    if (!status.ok()) fmt::print(stderr, "vorocast-simulation: {}\n", std::string(status.message()));
    return status.ok() ? EXIT_SUCCESS : EXIT_FAILURE;
  }
  if (live_command->parsed()) {
    live.security = live_security.Get();
    // What comes through a pipe is a script.
    const absl::Status status = simulation::RunLive(live, std::cin, isatty(STDIN_FILENO) == 0);
    if (!status.ok()) fmt::print(stderr, "vorocast-simulation: {}\n", std::string(status.message()));
    return status.ok() ? EXIT_SUCCESS : EXIT_FAILURE;
  }
  if (options.lease.scheduler.empty() && options.listen.empty()) {
    fmt::print(stderr, "vorocast-simulation: nothing to do; give --scheduler, --listen, or both\n");
    return EXIT_FAILURE;
  }
  flags.Apply(options.lease);
  const absl::Status status = Serve(options);
  if (status.ok()) return EXIT_SUCCESS;
  fmt::print(stderr, "vorocast-simulation: {}\n", std::string(status.message()));
  return EXIT_FAILURE;
}
