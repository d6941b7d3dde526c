// SPDX-License-Identifier: AGPL-3.0-or-later
#include <gtest/gtest.h>

#include <cmath>
#include <iostream>

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

/// As measured on real takes, in proportion: stages of very different length, and tasks that differ.
FarmTimes RealTimes(std::int32_t frames) {
  FarmTimes times;
  const auto of = [&times](tasks::Kind kind) -> TaskTime& { return times.of[static_cast<std::size_t>(kind)]; };
  for (TaskTime& time : times.of) time.spread = 0.25;
  of(tasks::Kind::kTessellate).start_s = 0.9;
  of(tasks::Kind::kTemplate).start_s = 5;
  of(tasks::Kind::kStretch).start_s = 3.5;
  of(tasks::Kind::kGuide).start_s = 1.5 + 0.01 * frames;
  of(tasks::Kind::kTrack).start_s = 2.5;
  of(tasks::Kind::kAssemble).start_s = 0.025 * frames;
  return times;
}

TEST(Forecast, IsHonestOnAnyNumberOfWorkers) {
  constexpr std::int32_t kFrames = 400;
  for (const std::int32_t workers : {1, 8, 64, 1000}) {
    const auto run = RunClockedFarm(TrackedOnly(), kFrames, workers, RealTimes(kFrames));
    ASSERT_TRUE(run.ok()) << run.status();
    double worst = 0;
    int seen = 0;
    for (const auto& [at, left] : run->forecasts) {
      // At first it goes by what is typical; what is measured then takes over.
      if (at < 0.2 * run->wall_s) continue;
      ++seen;
      worst = std::max(worst, std::abs(at + left - run->wall_s) / run->wall_s);
    }
    std::cout << "forecast on " << workers << " workers: " << run->wall_s << " s, off by " << 100 * worst << " % at most\n";
    EXPECT_GT(seen, 5);
    EXPECT_LT(worst, 0.3) << workers;
  }
}

}  // namespace
}  // namespace vorocast::scenario
