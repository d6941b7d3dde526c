// SPDX-License-Identifier: AGPL-3.0-or-later
#include "scheduler/fleet/slurm_fleet.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <functional>
#include <map>
#include <mutex>
#include <sstream>
#include <string>
#include <vector>

#include <fmt/format.h>

#include "absl/time/clock.h"
#include "scheduler/fleet/fleet_flags.h"

namespace vorocast::fleet {
namespace {

using testing::AllOf;
using testing::Contains;
using testing::HasSubstr;
using testing::Not;

/// Answers as Slurm does: what is submitted waits in the queue until it is started.
class FakeSlurm {
 public:
  absl::StatusOr<std::string> Run(const std::vector<std::string>& arguments) {
    const std::lock_guard lock(mutex_);
    commands_.push_back(arguments);
    if (down_) return absl::UnavailableError("squeue: ended with code 1: Unable to contact slurm controller");
    if (arguments[0] == "squeue") return Queue();
    if (arguments[0] == "sbatch") return Submit(arguments);
    for (const std::string& name : arguments) states_.erase(name);
    return std::string();
  }
  void StartAll() {
    const std::lock_guard lock(mutex_);
    for (auto& [name, state] : states_) state = "RUNNING";
  }
  void set_down(bool down) {
    const std::lock_guard lock(mutex_);
    down_ = down;
  }
  std::size_t size() const {
    const std::lock_guard lock(mutex_);
    return states_.size();
  }
  std::size_t Count(const std::string& program) const { return Commands(program).size(); }
  std::vector<std::vector<std::string>> Commands(const std::string& program) const {
    const std::lock_guard lock(mutex_);
    std::vector<std::vector<std::string>> found;
    for (const auto& command : commands_) {
      if (command[0] == program) found.push_back(command);
    }
    return found;
  }

 private:
  std::string Queue() const {
    std::string jobs;
    for (const auto& [name, state] : states_) {
      const std::size_t line = name.find('_');
      jobs += fmt::format(R"({}{{"name": "{}", "job_state": "{}", "array_job_id": {}, "array_task_id": {}, "array_task_string": ""}})",
                          jobs.empty() ? "" : ",", job_name_, state, name.substr(0, line), name.substr(line + 1));
    }
    return fmt::format(R"({{"jobs": [{}]}})", jobs);
  }
  std::string Submit(const std::vector<std::string>& arguments) {
    ++job_;
    for (const std::string& argument : arguments) {
      if (argument.starts_with("--job-name=")) job_name_ = argument.substr(11);
      if (!argument.starts_with("--array=1-")) continue;
      for (int task = 1; task <= std::stoi(argument.substr(10)); ++task) states_[fmt::format("{}_{}", job_, task)] = "PENDING";
    }
    return fmt::format("{}\n", job_);
  }

  mutable std::mutex mutex_;
  std::vector<std::vector<std::string>> commands_;
  std::map<std::string, std::string> states_;
  std::string job_name_ = "none";
  int job_ = 0;
  bool down_ = false;
};

class SlurmFleetTest : public testing::Test {
 protected:
  void SetUp() override {
    state_ = std::filesystem::temp_directory_path() /
             fmt::format("vorocast_slurm_{}_{}", testing::UnitTest::GetInstance()->current_test_info()->name(), getpid());
    std::filesystem::remove_all(state_);
  }
  void TearDown() override {
    fleet_.reset();
    std::filesystem::remove_all(state_);
  }
  void Start() {
    SlurmFleetOptions options{
        .state = state_, .scheduler = "one:7400", .worker = "/opt/vorocast-worker", .partition = "farm", .extra = {"--account=film"}};
    options.limits = {.workers_max = 4, .queued_max = 3, .surplus_seconds = 0};
    options.poll = absl::Milliseconds(2);
    options.pause_max = absl::Milliseconds(8);
    options.demand = [this]() -> absl::StatusOr<Demand> {
      const std::lock_guard lock(mutex_);
      return demand_;
    };
    options.run = [this](const std::vector<std::string>& arguments) { return slurm_.Run(arguments); };
    auto fleet = SlurmFleet::Start(std::move(options));
    ASSERT_TRUE(fleet.ok()) << fleet.status();
    fleet_ = *std::move(fleet);
  }
  void SetDemand(Demand demand) {
    const std::lock_guard lock(mutex_);
    demand_ = std::move(demand);
  }
  static bool Await(const std::function<bool()>& holds) {
    const absl::Time deadline = absl::Now() + absl::Seconds(20);
    while (absl::Now() < deadline) {
      if (holds()) return true;
      absl::SleepFor(absl::Milliseconds(1));
    }
    return false;
  }
  /// So many further looks at the queue have had their consequences.
  bool AwaitRounds(std::size_t rounds) {
    const std::size_t seen = slurm_.Count("squeue");
    return Await([&] { return slurm_.Count("squeue") > seen + rounds; });
  }

  std::filesystem::path state_;
  FakeSlurm slurm_;
  std::mutex mutex_;
  Demand demand_;
  std::unique_ptr<SlurmFleet> fleet_;
};

const KindDemand kMuchWork{.ready = 1000, .seconds_mean = 100};

TEST_F(SlurmFleetTest, AsksForWorkersWithABoundedNumberInTheQueue) {
  SetDemand({.kinds = {kMuchWork}});
  Start();
  ASSERT_TRUE(Await([&] { return slurm_.size() == 3; }));
  ASSERT_TRUE(AwaitRounds(5));
  EXPECT_EQ(slurm_.size(), 3u);
  slurm_.StartAll();
  SetDemand({.kinds = {kMuchWork}, .busy_workers = {"slurm-1_1-0", "slurm-1_2-0", "slurm-1_3-0"}});
  ASSERT_TRUE(Await([&] { return slurm_.size() == 4; }));
  ASSERT_TRUE(AwaitRounds(5));
  EXPECT_EQ(slurm_.size(), 4u) << "more than --workers-max";
  const auto asked = slurm_.Commands("sbatch").front();
  EXPECT_THAT(asked, AllOf(Contains("--partition=farm"), Contains("--array=1-3"), Contains("--requeue"), Contains("--account=film")));
  EXPECT_THAT(asked, AllOf(Contains("/opt/vorocast-worker"), Contains("one:7400")));
  EXPECT_TRUE(std::filesystem::exists(state_ / "slurm" / "worker.sh"));
}

TEST_F(SlurmFleetTest, AGrowingBacklogIsMetByFurtherArrays) {
  // 300 s of work and twice as long to do it: one worker.
  SetDemand({.kinds = {{.ready = 3, .seconds_mean = 100}}});
  Start();
  ASSERT_TRUE(Await([&] { return slurm_.size() == 1; }));
  ASSERT_TRUE(AwaitRounds(5));
  EXPECT_EQ(slurm_.size(), 1u);
  slurm_.StartAll();
  // A second take comes while the first is being worked on.
  SetDemand({.kinds = {{.ready = 11, .running = 1, .seconds_mean = 100}}, .busy_workers = {"slurm-1_1-0"}});
  ASSERT_TRUE(Await([&] { return slurm_.size() == 2; }));
  slurm_.StartAll();
  SetDemand({.kinds = {kMuchWork, {.ready = 11, .running = 2, .seconds_mean = 100}}, .busy_workers = {"slurm-1_1-0", "slurm-2_1-0"}});
  ASSERT_TRUE(Await([&] { return slurm_.size() == 4; }));
  ASSERT_TRUE(AwaitRounds(5));
  EXPECT_EQ(slurm_.size(), 4u) << "more than --workers-max";
  const auto arrays = slurm_.Commands("sbatch");
  ASSERT_EQ(arrays.size(), 3u);
  EXPECT_THAT(arrays[0], Contains("--array=1-1"));
  EXPECT_THAT(arrays[1], Contains("--array=1-1"));
  EXPECT_THAT(arrays[2], Contains("--array=1-2"));
}

TEST_F(SlurmFleetTest, DrainsOnlyIdleWorkersWhenTheWorkIsGone) {
  SetDemand({.kinds = {kMuchWork}});
  Start();
  ASSERT_TRUE(Await([&] { return slurm_.size() == 3; }));
  slurm_.StartAll();
  SetDemand(
      {.kinds = {{.running = 1, .seconds_mean = 1}}, .idle_workers = {"slurm-1_1-0", "slurm-1_3-2", "worker-7"}, .busy_workers = {"slurm-1_2-0"}});
  ASSERT_TRUE(Await([&] { return slurm_.size() == 1; }));
  ASSERT_TRUE(AwaitRounds(3));
  EXPECT_EQ(slurm_.size(), 1u);
  const auto drained = slurm_.Commands("scancel").front();
  EXPECT_THAT(drained, AllOf(Contains("--signal=TERM"), Contains("--batch"), Contains("1_1"), Contains("1_3"), Not(Contains("1_2"))));
}

TEST_F(SlurmFleetTest, WithdrawsWhatWaitsInVain) {
  SetDemand({.kinds = {kMuchWork}});
  Start();
  ASSERT_TRUE(Await([&] { return slurm_.size() == 3; }));
  SetDemand({});
  ASSERT_TRUE(Await([&] { return slurm_.size() == 0; }));
  EXPECT_THAT(slurm_.Commands("scancel").front(), Contains("--state=PENDING"));
}

TEST_F(SlurmFleetTest, SaysThatSlurmIsDownAndGoesOnWhenItIsBack) {
  SetDemand({.kinds = {kMuchWork}});
  slurm_.set_down(true);
  Start();
  ASSERT_TRUE(Await([&] { return fleet_->Describe().find("Unable to contact") != std::string::npos; }));
  ASSERT_TRUE(AwaitRounds(3));
  EXPECT_EQ(slurm_.Count("sbatch"), 0u);
  std::stringstream told;
  told << std::ifstream(state_ / "slurm" / "status.txt").rdbuf();
  EXPECT_THAT(told.str(), HasSubstr("Unable to contact"));
  slurm_.set_down(false);
  ASSERT_TRUE(Await([&] { return slurm_.size() == 3; }));
  ASSERT_TRUE(Await([&] { return fleet_->Describe() == "Slurm: 0 workers up, 3 queued, at most 4"; })) << fleet_->Describe();
}

TEST_F(SlurmFleetTest, TheNextSchedulerFindsTheWorkers) {
  SetDemand({.kinds = {kMuchWork}});
  Start();
  ASSERT_TRUE(Await([&] { return slurm_.size() == 3; }));
  fleet_.reset();
  EXPECT_EQ(slurm_.size(), 3u);
  Start();
  ASSERT_TRUE(AwaitRounds(5));
  EXPECT_EQ(slurm_.Count("sbatch"), 1u);
}

TEST(FleetAddress, AnyAddressBecomesThisMachine) {
  EXPECT_EQ(AddressForOthers("0.0.0.0:7400", "one"), "one:7400");
  EXPECT_EQ(AddressForOthers("[::]:7400", "one"), "one:7400");
  EXPECT_EQ(AddressForOthers("10.0.0.4:7400", "one"), "10.0.0.4:7400");
}

}  // namespace
}  // namespace vorocast::fleet
