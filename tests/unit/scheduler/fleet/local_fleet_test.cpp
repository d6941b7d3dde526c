// SPDX-License-Identifier: AGPL-3.0-or-later
#include "scheduler/fleet/local_fleet.h"

#include <gtest/gtest.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <functional>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "absl/time/clock.h"

namespace vorocast::fleet {
namespace {

class LocalFleetTest : public testing::Test {
 protected:
  void SetUp() override {
    state_ = std::filesystem::temp_directory_path() /
             fmt::format("vorocast_fleet_{}_{}", testing::UnitTest::GetInstance()->current_test_info()->name(), getpid());
    std::filesystem::remove_all(state_);
    std::filesystem::create_directories(state_);
  }
  void TearDown() override { std::filesystem::remove_all(state_); }

  FleetOptions Options(const std::string& seconds = "1000") const {
    return {.state = state_, .members = {{"a", {"/bin/sleep", seconds}}, {"b", {"/bin/sleep", seconds}}}, .poll = absl::Milliseconds(5)};
  }
  std::vector<ProcessId> Recorded() const {
    std::ifstream file(state_ / "fleet.json");
    std::vector<ProcessId> processes;
    const auto json = nlohmann::json::parse(file, nullptr, false);
    if (!json.is_array()) return processes;
    for (const auto& member : json) processes.push_back({member["pid"], member["start_time"]});
    return processes;
  }
  static bool Await(const std::function<bool()>& holds) {
    const absl::Time deadline = absl::Now() + absl::Seconds(20);
    while (absl::Now() < deadline) {
      if (holds()) return true;
      absl::SleepFor(absl::Milliseconds(2));
    }
    return false;
  }

  std::filesystem::path state_;
};

TEST_F(LocalFleetTest, StartsAndStopsItsMembers) {
  auto fleet = LocalFleet::Start(Options());
  ASSERT_TRUE(fleet.ok()) << fleet.status();
  const auto processes = Recorded();
  ASSERT_EQ(processes.size(), 2u);
  for (const ProcessId& process : processes) {
    EXPECT_TRUE(IsAlive(process));
    EXPECT_EQ(getpgid(process.pid), process.pid);
  }
  fleet->reset();
  for (const ProcessId& process : processes) EXPECT_FALSE(IsAlive(process));
}

TEST_F(LocalFleetTest, StartsAMemberThatDiedAgain) {
  const auto fleet = LocalFleet::Start(Options());
  ASSERT_TRUE(fleet.ok());
  const ProcessId first = Recorded()[0];
  Signal(first, SIGKILL);
  EXPECT_TRUE(Await([&] {
    const auto now = Recorded();
    return now.size() == 2 && now[0].pid != first.pid && IsAlive(now[0]);
  }));
}

TEST_F(LocalFleetTest, TakesUpMembersThatOutlivedTheirFleet) {
  // A child process starts the fleet and is killed, as a scheduler may be.
  int ready[2];
  ASSERT_EQ(pipe(ready), 0);
  const pid_t child = fork();
  if (child == 0) {
    const auto fleet = LocalFleet::Start(Options());
    const char byte = fleet.ok() ? 'y' : 'n';
    if (write(ready[1], &byte, 1) == 1) pause();
    _exit(0);
  }
  char byte = 0;
  ASSERT_EQ(read(ready[0], &byte, 1), 1);
  kill(child, SIGKILL);
  waitpid(child, nullptr, 0);
  const auto before = Recorded();
  for (const ProcessId& process : before) EXPECT_TRUE(IsAlive(process));
  {
    const auto fleet = LocalFleet::Start(Options());
    ASSERT_TRUE(fleet.ok());
    EXPECT_EQ((*fleet)->adopted(), 2u);
    ASSERT_EQ(Recorded().size(), 2u);
    EXPECT_EQ(Recorded()[0].pid, before[0].pid);
  }
  for (const ProcessId& process : before) EXPECT_FALSE(IsAlive(process));
}

TEST_F(LocalFleetTest, ANumberUsedAgainIsNotTakenForAMember) {
  std::ofstream(state_ / "fleet.json") << nlohmann::json::array(
      {{{"name", "a"}, {"pid", getpid()}, {"start_time", 1}, {"arguments", {"/bin/sleep", "1000"}}}});
  const auto fleet = LocalFleet::Start(Options());
  ASSERT_TRUE(fleet.ok());
  EXPECT_EQ((*fleet)->adopted(), 0u);
}

TEST_F(LocalFleetTest, SaysWhichProgramCannotBeStarted) {
  const auto fleet = LocalFleet::Start({.state = state_, .members = {{"x", {"/nowhere/program"}}}});
  EXPECT_EQ(fleet.status().code(), absl::StatusCode::kUnavailable);
}

}  // namespace
}  // namespace vorocast::fleet
