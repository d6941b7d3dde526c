// SPDX-License-Identifier: AGPL-3.0-or-later
#include <gtest/gtest.h>

#include "tests/scenario/clocked_farm.h"

namespace vorocast::scenario {
namespace {

FarmTimes Times() {
  FarmTimes times;
  for (TaskTime& time : times.of) time = {.start_s = 1};
  return times;
}

plan::JobSpec TrackedOnly() {
  plan::JobSpec job;
  job.sheets = false;
  job.window_frames = 10;
  job.overlap_frames = 3;
  return job;
}

TEST(Scaling, OneWorkerIsNeverIdle) {
  const plan::JobSpec job = TrackedOnly();
  const auto run = RunClockedFarm(job, 100, 1, Times());
  ASSERT_TRUE(run.ok()) << run.status();
  // 100 frames, the template, two stretches, the guide, 14 windows, the assembly; each a second.
  EXPECT_EQ(run->tasks, 119);
  EXPECT_GT(run->wall_s, 119);
  EXPECT_LT(run->wall_s, 119 * 1.05);
  EXPECT_NEAR(run->busy_s, 119 * 1.02, 0.01);
}

TEST(Scaling, ManyWorkersWaitForTheLongestChainOnly) {
  const plan::JobSpec job = TrackedOnly();
  const auto run = RunClockedFarm(job, 100, 1000, Times());
  ASSERT_TRUE(run.ok()) << run.status();
  // A frame, the template or a stretch, the guide, a window, the assembly.
  EXPECT_GT(run->wall_s, 5);
  EXPECT_LT(run->wall_s, 5.5);
}

TEST(Scaling, ATaskMayTakeLongerThanALeaseLasts) {
  const plan::JobSpec job = TrackedOnly();
  FarmTimes times = Times();
  times.of[static_cast<std::size_t>(tasks::Kind::kAssemble)].start_s = 100;
  const auto run = RunClockedFarm(job, 100, 1000, times);
  ASSERT_TRUE(run.ok()) << run.status();
  EXPECT_NEAR(run->busy_s, 218 + 119 * 0.02, 0.01);
  EXPECT_LT(run->wall_s, 104.5);
}

}  // namespace
}  // namespace vorocast::scenario
