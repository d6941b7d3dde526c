// SPDX-License-Identifier: AGPL-3.0-or-later
// A job on workers that a real Slurm provides. Whatever is killed on the way, it ends with the results of an undisturbed run on one machine,
// and afterwards no worker is left.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <signal.h>

#include <chrono>
#include <filesystem>
#include <fstream>
#include <map>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "services/base/random.h"
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

/// A Slurm of two nodes, a scheduler that takes its workers from there, and what a job gives that runs undisturbed on one machine.
class Slurm : public testing::Test {
 protected:
  void SetUp() override {
    cluster_ = support::SlurmCluster::Start(2, 1);
    if (!cluster_) GTEST_SKIP() << "Slurm is not installed: deploy/install_packages.sh";
    folder_ = Scratch() / testing::UnitTest::GetInstance()->current_test_info()->name();
    state_ = folder_ / "state";
    scheduler_ = std::make_unique<Running>(
        std::vector<std::string>{"--state", state_.string(), "--listen", "127.0.0.1:0", "--fleet", "slurm", "--slurm-partition", "farm",
                                 "--workers-max", "2", "--finish-in", "1", "--slurm-poll", "0.2", "--idle", "1", "--drain-time", "3"},
        "vorocast-scheduler");
    ASSERT_TRUE(Eventually([&] { return !AddressOf(state_).empty(); }, 30));
    ASSERT_FALSE(Undisturbed().empty());
  }

  static const std::string& Capture() {
    static const std::string capture = [] {
      const std::string made = (Scratch() / "capture").string();
      EXPECT_EQ(RunProgram({"synth", made, "--count", "8", "--points", "8000"}).exit_code, 0);
      return made;
    }();
    return capture;
  }
  static const std::map<std::string, std::string>& Undisturbed() {
    static const std::map<std::string, std::string> digests = [] {
      const std::filesystem::path folder = Scratch() / "undisturbed";
      const Outcome outcome =
          RunProgram(JobFlags({"run", Capture(), "--out", (folder / "out").string(), "--state", (folder / "state").string(), "--workers", "1"}));
      EXPECT_EQ(outcome.exit_code, 0) << outcome.output;
      return Digests(folder / "out");
    }();
    return digests;
  }

  std::string Address() const { return AddressOf(state_); }
  void ExpectUndisturbedResults(Running& job) {
    const Outcome outcome = job.Wait();
    EXPECT_EQ(outcome.exit_code, 0) << outcome.output;
    const Outcome fetched = RunProgram({"fetch", "--to", Address(), "--out", (folder_ / "out").string()});
    EXPECT_EQ(fetched.exit_code, 0) << fetched.output;
    EXPECT_EQ(Digests(folder_ / "out"), Undisturbed());
  }
  /// With the cluster in order again, nobody stays without work, and the scheduler ends when it is told to.
  void ExpectGoodOrder() {
    cluster_->Repair();
    EXPECT_TRUE(Eventually([&] { return cluster_->Count("RUNNING,PENDING") == 0; }, 90)) << "workers without work";
    scheduler_->Signal(SIGTERM);
    EXPECT_EQ(scheduler_->Wait().exit_code, 0);
  }

  std::unique_ptr<support::SlurmCluster> cluster_;
  std::filesystem::path folder_, state_;
  std::unique_ptr<Running> scheduler_;
};

TEST_F(Slurm, AJobOutlivesAWorkerAndANodesDaemonAndTheArrayEndsWithTheWork) {
  EXPECT_EQ(cluster_->Count("RUNNING"), 0) << "workers without work";
  Running job(JobFlags({"submit", Capture(), "--to", Address(), "--watch"}));
  pid_t worker = -1;
  ASSERT_TRUE(Eventually([&] { return CountFiles(state_ / "artifacts") >= 2 && (worker = BusyWorker(state_)) > 0; }, 60));
  kill(worker, SIGKILL);
  cluster_->KillNode(1);
  ExpectUndisturbedResults(job);
  ExpectGoodOrder();
}

TEST_F(Slurm, AJobOutlivesWhateverIsKilledAtRandomMoments) {
  // The controller is away already when the work arrives: the scheduler must go on asking.
  cluster_->KillController();
  Running job(JobFlags({"submit", Capture(), "--to", Address(), "--watch"}));
  base::Random random(5);
  std::string story;
  for (int fault = 0; fault < 6 && !job.HasEnded(); ++fault) {
    std::this_thread::sleep_for(std::chrono::milliseconds(random.Below(1500)));
    const std::size_t victim = random.Below(4);
    if (victim < 2) {
      cluster_->KillNode(static_cast<int>(victim) + 1);
      story += fmt::format("slurmd of node {} killed\n", victim + 1);
    } else if (victim == 2) {
      cluster_->KillController();
      story += "slurmctld killed\n";
    } else if (const pid_t worker = BusyWorker(state_); worker > 0) {
      kill(worker, SIGKILL);
      story += "worker killed\n";
    }
    std::this_thread::sleep_for(std::chrono::milliseconds(random.Below(1000)));
    cluster_->Repair();
  }
  SCOPED_TRACE(story);
  ExpectUndisturbedResults(job);
  ExpectGoodOrder();
}

}  // namespace
}  // namespace vorocast::cluster
