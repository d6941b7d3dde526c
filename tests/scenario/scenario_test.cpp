// SPDX-License-Identifier: AGPL-3.0-or-later
#include <gtest/gtest.h>

#include <cstdlib>
#include <string>

#include "tests/scenario/simulated_farm.h"

namespace vorocast::scenario {
namespace {

Weather Storm() {
  return {.worker_dies = 0.003,
          .worker_hangs = 0.003,
          .stream_breaks = 0.01,
          .message_lost = 0.02,
          .message_doubled = 0.1,
          .attempt_fails = 0.1,
          .bad_frame = 0.1,
          .scheduler_dies = 0.02,
          .commit_unknown = 0.02,
          .leader_replaced = 0.005,
          .file_lost = 0.02,
          .user_acts = 0.005,
          .attempt_drags = 0.03,
          .worker_sickens = 0.001,
          .clock_jumps = 0.0005};
}

/// VOROCAST_SEED=17 replays one schedule; VOROCAST_SCHEDULES sets how many are tried.
void RunMany(const Weather& weather, std::uint64_t first_seed, std::uint64_t count) {
  if (const char* seed = std::getenv("VOROCAST_SEED")) first_seed = std::strtoull(seed, nullptr, 10), count = 1;
  if (const char* schedules = std::getenv("VOROCAST_SCHEDULES")) count = std::strtoull(schedules, nullptr, 10);
  std::int64_t steps = 0;
  std::int64_t refused = 0;
  std::int64_t copied = 0;
  std::int64_t set_aside = 0;
  for (std::uint64_t seed = first_seed; seed < first_seed + count; ++seed) {
    SimulatedFarm farm(seed, weather);
    const absl::Status status = farm.Run();
    steps += farm.steps();
    refused += farm.refused();
    copied += farm.copied();
    set_aside += farm.set_aside();
    ASSERT_TRUE(status.ok()) << "VOROCAST_SEED=" << seed << " build/bin/tests_scenario --gtest_filter=Scenario."
                             << testing::UnitTest::GetInstance()->current_test_info()->name() << " replays this: " << status;
  }
  testing::Test::RecordProperty("steps", std::to_string(steps));
  // The schedules must reach what they are for.
  if (weather.leader_replaced > 0 && count > 1) {
    EXPECT_GT(refused, 0);
  }
  if (weather.attempt_drags > 0 && count > 1) {
    EXPECT_GT(copied, 0);
  }
  if (weather.worker_sickens > 0 && count > 1) {
    EXPECT_GT(set_aside, 0);
  }
  testing::Test::RecordProperty("copied", std::to_string(copied));
  testing::Test::RecordProperty("refused", std::to_string(refused));
}

TEST(Scenario, FairWeather) { RunMany({}, 1, 200); }
TEST(Scenario, BadFrames) { RunMany({.bad_frame = 0.3}, 1'000, 200); }
TEST(Scenario, WorkersDieAndHang) { RunMany({.worker_dies = 0.01, .worker_hangs = 0.01}, 2'000, 200); }
TEST(Scenario, TheNetworkBreaks) { RunMany({.stream_breaks = 0.03, .message_lost = 0.05, .message_doubled = 0.3}, 3'000, 200); }
TEST(Scenario, AttemptsFail) { RunMany({.attempt_fails = 0.3}, 4'000, 200); }
TEST(Scenario, TheSchedulerDiesAroundItsCommits) { RunMany({.scheduler_dies = 0.1, .file_lost = 0.05}, 5'000, 200); }
TEST(Scenario, CommitsTimeOutAlthoughTheyAreWritten) { RunMany({.commit_unknown = 0.2}, 7'000, 200); }
TEST(Scenario, AReplacedLeaderWakes) { RunMany({.stream_breaks = 0.01, .leader_replaced = 0.02}, 8'000, 500); }
TEST(Scenario, UsersChangeTheirMinds) { RunMany({.attempt_fails = 0.1, .bad_frame = 0.2, .user_acts = 0.03}, 6'000, 200); }
TEST(Scenario, AttemptsDrag) { RunMany({.worker_dies = 0.003, .attempt_fails = 0.05, .attempt_drags = 0.2}, 20'000, 200); }
TEST(Scenario, WorkersFallIll) { RunMany({.stream_breaks = 0.003, .attempt_drags = 0.05, .worker_sickens = 0.01}, 21'000, 200); }
TEST(Scenario, TheClockJumps) { RunMany({.worker_sickens = 0.003, .clock_jumps = 0.01}, 22'000, 200); }
TEST(Scenario, EverythingAtOnce) { RunMany(Storm(), 10'000, 2'000); }

}  // namespace
}  // namespace vorocast::scenario
