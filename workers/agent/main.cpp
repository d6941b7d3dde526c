// SPDX-License-Identifier: AGPL-3.0-or-later
// vorocast-worker: takes leases for everything but simulation and runs each task in a child process of its own.
#include <unistd.h>

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <string_view>
#include <thread>

#include <fmt/format.h>
#include <CLI/CLI.hpp>
#include "services/lease/lease_loop.h"
#include "workers/agent/executors.h"

namespace {

#ifdef __AVX2__
/// Says so in words, before the first instruction that an older processor does not know: the program is built for x86-64-v3.
[[gnu::constructor(101), gnu::target("arch=x86-64")]] void RequireInstructionSet() {
  __builtin_cpu_init();
  if (__builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma") && __builtin_cpu_supports("bmi2")) return;
  static constexpr char kMessage[] =
      "vorocast-worker: this processor lacks AVX2, FMA or BMI2; use another machine, or build with -DVOROCAST_MARCH=x86-64\n";
  [[maybe_unused]] const ssize_t written = ::write(STDERR_FILENO, kMessage, sizeof(kMessage) - 1);
  ::_exit(EXIT_FAILURE);
}
#endif

constexpr char kStory[] =
    "Takes tasks from a Vorocast scheduler and runs each in a process of its own, with its memory and time limits.\n"
    "Results go to the shared artifact folder that the scheduler names. When the scheduler is away, the worker goes on with\n"
    "what it holds and connects again. SIGTERM or Ctrl-C lets it finish what runs and leave; a second one stops at once.";

}  // namespace

int main(int argc, char** argv) {
  using namespace vorocast;
  CLI::App app(kStory, "vorocast-worker");
  lease::LeaseLoopOptions options;
  options.slots = static_cast<std::int32_t>(std::max(1u, std::thread::hardware_concurrency()));
  double drain_seconds = absl::ToDoubleSeconds(options.drain_time);
  app.add_option("--scheduler", options.scheduler, "The scheduler's address: HOST:PORT or unix:/PATH")->envname("VOROCAST_SCHEDULER");
  app.add_option("--slots", options.slots, "Tasks at once")->check(CLI::Range(1, 10000))->capture_default_str();
  app.add_option("--name", options.name, "Name among the workers; host, process number and start time if not given");
  app.add_option("--drain-time", drain_seconds, "Seconds that running tasks get after SIGTERM before they are given back")
      ->check(CLI::Range(0.0, 86400.0))
      ->capture_default_str();
  CLI::App* execute_task = app.add_subcommand("execute-task", "Runs one task given on standard input; the worker starts this itself");
  CLI11_PARSE(app, argc, argv);

  const std::vector<std::unique_ptr<lease::Executor>> executors = agent::AllExecutors();
  if (execute_task->parsed()) return lease::ExecuteTaskMain(executors);

  std::error_code error;
  options.program = std::filesystem::read_symlink("/proc/self/exe", error);
  options.drain_time = absl::Seconds(drain_seconds);
  std::vector<tasks::Kind> kinds;
  for (const auto& executor : executors) kinds.push_back(executor->kind());
  const absl::Status status = lease::RunLeaseLoop(options, kinds);
  if (status.ok()) return EXIT_SUCCESS;
  fmt::print(stderr, "vorocast-worker: {}\n", std::string(status.message()));
  return EXIT_FAILURE;
}
