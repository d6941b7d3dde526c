// SPDX-License-Identifier: AGPL-3.0-or-later
// vorocast-worker: takes leases for everything but simulation and runs each task in a child process of its own.
#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <string_view>
#include <thread>

#include <fmt/format.h>
#include <CLI/CLI.hpp>
#include "services/base/processor.h"
#include "services/lease/lease_flags.h"
#include "services/lease/lease_loop.h"
#include "services/lease/lease_metrics.h"
#include "services/telemetry/telemetry_flags.h"
#include "workers/agent/executors.h"

namespace {

constexpr char kStory[] =
    "Takes tasks from a Vorocast scheduler and runs each in a process of its own, with its memory and time limits.\n"
    "Results go to the shared artifact folder that the scheduler names, or through the scheduler (--artifacts remote). When the\n"
    "scheduler is away, the worker goes on with what it holds and connects again. SIGTERM or Ctrl-C lets it finish what runs and\n"
    "leave; a second one stops at once.\n"
    "It exits with code 75 when it had to give tasks back then, so that a cluster may start it again elsewhere.";

}  // namespace

int main(int argc, char** argv) {
  using namespace vorocast;
  base::RequireProcessor();
  CLI::App app(kStory, "vorocast-worker");
  lease::LeaseLoopOptions options;
  options.slots = static_cast<std::int32_t>(std::max(1u, std::thread::hardware_concurrency()));
  app.add_option("--scheduler", options.scheduler, "The scheduler's address: HOST:PORT or unix:/PATH; A,B where one stands by")
      ->envname("VOROCAST_SCHEDULER");
  lease::LeaseFlags flags;
  flags.AddTo(app, options, "Tasks at once");
  telemetry::TelemetryFlags telemetry_flags;
  telemetry_flags.AddTo(app);
  CLI::App* execute_task = app.add_subcommand("execute-task", "Runs one task given on standard input; the worker starts this itself");
  CLI11_PARSE(app, argc, argv);

  const std::vector<std::unique_ptr<lease::Executor>> executors = agent::AllExecutors();
  if (execute_task->parsed()) return lease::ExecuteTaskMain(executors);

  flags.Apply(options);
  absl::Status status = telemetry_flags.StartLog("worker");
  lease::LeaseMetrics metrics("worker", options.slots);
  const auto metrics_server = telemetry_flags.StartMetrics(metrics.registry());
  status.Update(metrics_server.status());
  options.metrics = &metrics;
  std::vector<tasks::Kind> kinds;
  for (const auto& executor : executors) kinds.push_back(executor->kind());
  lease::LeaseLoopSummary summary;
  if (status.ok()) status = lease::RunLeaseLoop(options, kinds, &summary);
  if (summary.told_to_stop && summary.given_back > 0) return lease::kWorkLeft;
  if (status.ok()) return EXIT_SUCCESS;
  fmt::print(stderr, "vorocast-worker: {}\n", std::string(status.message()));
  return EXIT_FAILURE;
}
