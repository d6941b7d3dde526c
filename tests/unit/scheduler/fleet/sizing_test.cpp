// SPDX-License-Identifier: AGPL-3.0-or-later
#include "scheduler/fleet/sizing.h"

#include <gtest/gtest.h>

namespace vorocast::fleet {
namespace {

constexpr SizingLimits kLimits{.workers_max = 64, .queued_max = 100, .seconds_guess = 10, .seconds_left_floor = 60, .surplus_seconds = 30};

SizingInput Work(KindDemand kind, double seconds_left) { return {.demand = {.kinds = {kind}}, .seconds_left = seconds_left}; }

TEST(Sizing, AsksForAsManyAsTheTimeLeftTakes) {
  // 1000 tasks of 3 s are 3000 s of work: ten workers need 300 s for it.
  EXPECT_EQ(Size(Work({.ready = 1000, .seconds_mean = 3}, 300), kLimits).ask, 10);
  EXPECT_EQ(Size(Work({.blocked = 1000, .seconds_mean = 3}, 300), kLimits).ask, 10);
  EXPECT_EQ(Size(Work({.ready = 1000, .seconds_mean = 3}, 3000), kLimits).ask, 1);
}

TEST(Sizing, SlotsShareTheWork) {
  SizingLimits limits = kLimits;
  limits.slots = 4;
  EXPECT_EQ(Size(Work({.ready = 1000, .seconds_mean = 3}, 300), limits).ask, 3);  // ten slots
  EXPECT_EQ(Size(Work({.ready = 6, .seconds_mean = 1000}, 60), limits).ask, 2);   // six tasks
}

TEST(Sizing, GuessesWhatHasNotBeenMeasured) { EXPECT_EQ(Size(Work({.ready = 60}, 60), kLimits).ask, 10); }

TEST(Sizing, NeverMoreThanThereAreTasksOrTheLimitAllows) {
  EXPECT_EQ(Size(Work({.ready = 3, .seconds_mean = 10000}, 60), kLimits).ask, 3);
  EXPECT_EQ(Size(Work({.ready = 100000, .seconds_mean = 100}, 60), kLimits).ask, 64);
}

TEST(Sizing, ADeadlineThatHasPassedIsNoReasonForEndlesslyMany) { EXPECT_EQ(Size(Work({.ready = 60, .seconds_mean = 10}, -1e9), kLimits).ask, 10); }

TEST(Sizing, CountsThoseThatComeAlready) {
  SizingInput input = Work({.ready = 1000, .seconds_mean = 3}, 300);
  input.workers_up = 4;
  input.workers_queued = 5;
  EXPECT_EQ(Size(input, kLimits).ask, 1);
  SizingLimits limits = kLimits;
  limits.queued_max = 5;
  EXPECT_EQ(Size(input, limits).ask, 0) << "the queue is as full as it may be";
  input.workers_queued = 2;
  EXPECT_EQ(Size(input, limits).ask, 3);
}

TEST(Sizing, KeepsWorkersThatAreUpWhileThereAreTasksForThem) {
  SizingInput input = Work({.ready = 30, .running = 10, .seconds_mean = 1}, 1000);
  input.workers_up = 40;
  input.seconds_with_surplus = 1000;
  const SizingDecision decision = Size(input, kLimits);
  EXPECT_EQ(decision.ask + decision.withdraw + decision.drain, 0);
  EXPECT_FALSE(decision.surplus);
}

TEST(Sizing, DrainsWhatCannotBeUsedAfterAWhileAndTheQueuedOnesAtOnce) {
  SizingInput input = Work({.running = 2, .seconds_mean = 1}, 1000);
  input.workers_up = 10;
  input.workers_queued = 4;
  SizingDecision decision = Size(input, kLimits);
  EXPECT_TRUE(decision.surplus);
  EXPECT_EQ(decision.withdraw, 4);
  EXPECT_EQ(decision.drain, 0);
  input.seconds_with_surplus = 30;
  EXPECT_EQ(Size(input, kLimits).drain, 8);
}

TEST(Sizing, WithoutWorkOnlyTheLeastNumberStays) {
  SizingLimits limits = kLimits;
  limits.workers_min = 2;
  EXPECT_EQ(Size({}, limits).ask, 2);
  EXPECT_EQ(Size({.workers_up = 5, .seconds_with_surplus = 60}, limits).drain, 3);
  EXPECT_EQ(Size({}, kLimits).ask, 0);
}

}  // namespace
}  // namespace vorocast::fleet
