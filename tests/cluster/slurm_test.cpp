// SPDX-License-Identifier: AGPL-3.0-or-later
// A job on workers that a real Slurm provides. Whatever is killed on the way, it ends with the results of an undisturbed run on one machine,
// and afterwards no worker is left.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <signal.h>

#include <filesystem>
#include <fstream>
#include <memory>
#include <string>
#include <vector>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "tests/cluster/programs.h"
#include "tests/support/slurm_cluster.h"

namespace vorocast::cluster {
namespace {

std::vector<std::string> JobFlags(std::vector<std::string> command) {
  command.insert(command.end(), {"--cells", "300", "--patches", "30", "--template", "0", "--no-sheets"});
  return command;
}

/// Where the scheduler of a state folder listens; empty while it does not.
std::string AddressOf(const std::filesystem::path& state) {
  std::ifstream file(state / "scheduler.json");
  const auto json = nlohmann::json::parse(file, nullptr, false);
  return json.is_object() ? json.value("address", "") : "";
}

/// A worker that writes its log into the state folder and has a task's process; −1 if there is none now.
pid_t BusyWorker(const std::filesystem::path& state) {
  for (const auto& entry : std::filesystem::directory_iterator("/proc", std::filesystem::directory_options::skip_permission_denied)) {
    const std::string number = entry.path().filename().string();
    if (number.find_first_not_of("0123456789") != std::string::npos) continue;
    std::error_code error;
    const auto log = std::filesystem::read_symlink(entry.path() / "fd" / "2", error);
    if (error || log.parent_path() != state / "logs") continue;
    std::ifstream file(entry.path() / "cmdline");
    std::string program;
    std::getline(file, program, '\0');
    const pid_t pid = std::stoi(number);
    if (program.ends_with("vorocast-worker") && ChildOf(pid) > 0) return pid;
  }
  return -1;
}

TEST(Slurm, AJobOutlivesAWorkerAndANodesDaemonAndTheArrayEndsWithTheWork) {
  const auto cluster = support::SlurmCluster::Start(2, 1);
  if (!cluster) GTEST_SKIP() << "Slurm is not installed: deploy/install_packages.sh";
  const std::filesystem::path folder = Scratch() / "slurm";
  const std::string capture = (folder / "capture").string();
  const std::filesystem::path state = folder / "state";
  ASSERT_EQ(RunProgram({"synth", capture, "--count", "8", "--points", "8000"}).exit_code, 0);
  const Outcome undisturbed =
      RunProgram(JobFlags({"run", capture, "--out", (folder / "undisturbed").string(), "--state", (folder / "local").string(), "--workers", "1"}));
  ASSERT_EQ(undisturbed.exit_code, 0) << undisturbed.output;

  Running scheduler({"--state", state.string(), "--listen", "127.0.0.1:0", "--fleet", "slurm", "--slurm-partition", "farm", "--workers-max", "2",
                     "--finish-in", "1", "--slurm-poll", "0.2", "--idle", "1", "--drain-time", "3"},
                    "vorocast-scheduler");
  ASSERT_TRUE(Eventually([&] { return !AddressOf(state).empty(); }, 30));
  const std::string address = AddressOf(state);
  EXPECT_EQ(cluster->Count("RUNNING"), 0) << "workers without work";

  Running job(JobFlags({"submit", capture, "--to", address, "--watch"}));
  pid_t worker = -1;
  ASSERT_TRUE(Eventually([&] { return CountFiles(state / "artifacts") >= 2 && (worker = BusyWorker(state)) > 0; }, 60));
  kill(worker, SIGKILL);
  cluster->KillNode(1);
  const Outcome outcome = job.Wait();
  EXPECT_EQ(outcome.exit_code, 0) << outcome.output;
  const Outcome fetched = RunProgram({"fetch", "--to", address, "--out", (folder / "out").string()});
  EXPECT_EQ(fetched.exit_code, 0) << fetched.output;

  auto expected = Digests(folder / "undisturbed");
  EXPECT_FALSE(expected.empty());
  EXPECT_EQ(Digests(folder / "out"), expected);

  cluster->Repair();
  EXPECT_TRUE(Eventually([&] { return cluster->Count("RUNNING,PENDING") == 0; }, 60)) << "workers without work";
  scheduler.Signal(SIGTERM);
  EXPECT_EQ(scheduler.Wait().exit_code, 0);
}

}  // namespace
}  // namespace vorocast::cluster
