// SPDX-License-Identifier: AGPL-3.0-or-later
// Who is given workers, how many, and which workers. The order of leases is held against a naive oracle in tests/scenario.
#include <gmock/gmock.h>

#include "core_bench.h"

namespace vorocast::core {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

TEST(Schedule, AUserWithManyJobsGetsNoMoreThanOneWithFew) {
  CoreBench bench;
  for (int job = 0; job < 5; ++job) bench.Job(fmt::format("a{}", job), 10, "anna", 0, 100 * job);
  bench.Job("b", 20, "bert", 0, 1000);
  bench.Connect(1, "w", 12);
  EXPECT_EQ(bench.state.leased_by_user.at("anna"), 6);
  EXPECT_EQ(bench.state.leased_by_user.at("bert"), 6);
}

TEST(Schedule, TheEarlierDeadlineOfAUserGoesFirstAndTakesNothingFromOthers) {
  CoreBench bench;
  bench.Job("a1", 2, "anna", 0, 0);
  bench.Job("a2", 2, "anna", 0, 10, {.deadline = 2000});
  bench.Job("a3", 2, "anna", 0, 20, {.deadline = 1000});
  bench.Job("b1", 3, "bert", 0, 30);
  bench.Connect(1, "w", 4);
  EXPECT_THAT(bench.TakeLabels(1), ElementsAre("frame 20: tessellate", "frame 30: tessellate", "frame 21: tessellate", "frame 31: tessellate"));
}

TEST(Schedule, AJobNeverHasMoreThanItMay) {
  CoreBench bench;
  bench.Job("a", 6, "anna", 5, 0, {.workers_max = 2});
  bench.Job("b", 3, "bert", 0, 10);
  bench.Connect(1, "w", 4);
  auto leases = bench.TakeLeases(1);
  ASSERT_EQ(leases.size(), 4u);
  EXPECT_EQ(leases[0].label, "frame 0: tessellate");
  EXPECT_EQ(leases[1].label, "frame 1: tessellate");
  EXPECT_EQ(leases[2].label, "frame 10: tessellate");
  EXPECT_THAT(bench.Explained("a", "frame 3: tessellate"), HasSubstr("2 workers at once"));
  bench.Succeed(1, leases[0].id);
  EXPECT_THAT(bench.TakeLabels(1), ElementsAre("frame 2: tessellate"));
}

TEST(Schedule, WhatTwoJobsWantRunsForTheOneThatHasRoom) {
  CoreBench bench;
  bench.Job("a", 3, "anna", 5, 0, {.workers_max = 1});
  bench.Job("b", 3, "bert", 0, 0);
  bench.Connect(1, "w", 3);
  EXPECT_THAT(bench.TakeLabels(1), ElementsAre("frame 0: tessellate", "frame 1: tessellate", "frame 2: tessellate"));
  EXPECT_EQ(FindJob(bench.state, "a")->at_work, 1);
  EXPECT_EQ(FindJob(bench.state, "b")->at_work, 2);
}

TEST(Schedule, APausedJobStartsNothingAndGoesOnWhenItIsResumed) {
  CoreBench bench;
  bench.Job("a", 3);
  bench.Connect(1, "w", 1);
  const auto first = bench.TakeLeases(1);
  bench.Happen(PauseJob{"a", true});
  bench.Succeed(1, first[0].id);
  EXPECT_THAT(bench.TakeLabels(1), IsEmpty());
  EXPECT_THAT(Explain(bench.state, *FindJob(bench.state, "a")), HasSubstr("is paused"));
  EXPECT_THAT(bench.Explained("a", "frame 1: tessellate"), HasSubstr("resume a"));
  EXPECT_LT(View(bench.state, *FindJob(bench.state, "a")).seconds_left, 0);
  bench.Happen(PauseJob{"a", true});
  EXPECT_EQ(bench.Count<JobPaused>(), 1) << "said once";
  bench.Happen(PauseJob{"a", false});
  EXPECT_THAT(bench.TakeLabels(1), ElementsAre("frame 1: tessellate"));
}

TEST(Schedule, WhatAPausedJobSharesWithAnotherStillRuns) {
  CoreBench bench;
  bench.Job("a", 2, "anna", 5);
  bench.Job("b", 2, "bert", 0);
  bench.Happen(PauseJob{"a", true});
  bench.Connect(1, "w", 1);
  const auto leases = bench.TakeLeases(1);
  ASSERT_EQ(leases.size(), 1u);
  EXPECT_EQ(leases[0].label, "frame 0: tessellate");
  bench.Succeed(1, leases[0].id);
  EXPECT_EQ(View(bench.state, *FindJob(bench.state, "a")).stages[0].done, 1);
}

TEST(Schedule, LimitsOfAJobAndOfItsRetry) {
  CoreBench bench;
  bench.Job("a", 1, "anna", 0, 0, {.memory_limit = std::int64_t{1} << 30, .time_factor = 0.5});
  bench.Connect(1, "w", 1);
  auto lease = bench.TakeLeases(1).front();
  EXPECT_EQ(lease.memory_limit, std::int64_t{1} << 30);
  EXPECT_EQ(lease.time_limit, absl::Minutes(10));
  bench.Fail(1, lease.id, Cause::kOutOfMemory);
  lease = bench.TakeLeases(1).front();
  EXPECT_EQ(lease.memory_limit, std::int64_t{2} << 30) << "twice as much, once";
  bench.Fail(1, lease.id, Cause::kTimedOut);
  lease = bench.TakeLeases(1).front();
  EXPECT_EQ(lease.time_limit, absl::Minutes(20));
  bench.Fail(1, lease.id, Cause::kOutOfMemory);
  bench.TakeLeases(1);
  bench.Happen(RetryJob{.job = "a", .memory_limit = std::int64_t{12} << 30, .time_factor = 3});
  EXPECT_EQ(bench.Count<JobLimited>(), 1);
  bench.Connect(2, "w2", 1);
  lease = bench.TakeLeases(2).front();
  EXPECT_EQ(lease.label, "frame 0: tessellate");
  EXPECT_EQ(lease.memory_limit, std::int64_t{12} << 30);
  EXPECT_EQ(lease.time_limit, absl::Hours(1));
}

/// Eight frames of which one takes long, on workers of one slot each.
class Straggler : public testing::Test {
 protected:
  void SetUp() override {
    bench_.Job("a", 8, "anna", 0, 0, terms_);
    for (ConnectionId c = 1; c <= 9; ++c) bench_.Connect(c, fmt::format("w{}", c));
    for (ConnectionId c = 1; c <= 9; ++c) {
      const auto leases = bench_.TakeLeases(c);
      if (leases.empty()) continue;
      if (leases[0].label == "frame 0: tessellate") {
        slow_ = leases[0].id;
        slow_at_ = c;
      } else {
        bench_.Succeed(c, leases[0].id);
      }
    }
    bench_.Pass(absl::Seconds(6));
    for (ConnectionId c = 1; c <= 9; ++c) {
      for (const Lease& lease : bench_.TakeLeases(c)) {
        if (lease.id.key == slow_.key) copy_ = lease.id, copy_at_ = c;
      }
    }
  }
  bool WasRevoked(ConnectionId connection, const AttemptId& id) const {
    return std::any_of(bench_.messages.begin(), bench_.messages.end(), [&](const Message& message) {
      const auto* revoke = std::get_if<Revoke>(&message.content);
      return revoke && message.connection == connection && revoke->ids.front() == id;
    });
  }
  bool IsDone() const { return std::holds_alternative<Done>(bench_.state.tasks[0].state); }

  JobTerms terms_;
  CoreBench bench_;
  AttemptId slow_, copy_;
  ConnectionId slow_at_ = 0, copy_at_ = 0;
};

TEST_F(Straggler, IsCopiedOnceAndTheCopyWins) {
  ASSERT_NE(copy_at_, 0u);
  EXPECT_NE(copy_at_, slow_at_);
  EXPECT_THAT(bench_.Explained("a", "frame 0: tessellate"), HasSubstr("takes long"));
  bench_.Succeed(copy_at_, copy_);
  EXPECT_TRUE(IsDone());
  EXPECT_TRUE(WasRevoked(slow_at_, slow_));
  const auto made = bench_.Count<ResultMade>();
  bench_.Succeed(slow_at_, slow_);
  EXPECT_EQ(bench_.Count<ResultMade>(), made) << "one accepted result";
}

TEST_F(Straggler, TheFirstMayStillWin) {
  bench_.Succeed(slow_at_, slow_);
  EXPECT_TRUE(IsDone());
  EXPECT_TRUE(WasRevoked(copy_at_, copy_));
}

TEST_F(Straggler, WhenOneFailsOrIsLostTheOtherGoesOn) {
  bench_.Fail(slow_at_, slow_, Cause::kCrashed);
  EXPECT_FALSE(IsDone());
  bench_.Succeed(copy_at_, copy_);
  EXPECT_TRUE(IsDone());
}

TEST_F(Straggler, BadInputEndsBoth) {
  bench_.Fail(copy_at_, copy_, Cause::kInput);
  EXPECT_TRUE(std::holds_alternative<Failed>(bench_.state.tasks[0].state));
  EXPECT_TRUE(WasRevoked(slow_at_, slow_));
}

TEST_F(Straggler, BothOutlastTheScheduler) {
  CoreBench next;
  for (const Record& record : bench_.records) {
    const auto* saved = std::get_if<RunSaved>(&record);
    if (!saved || saved->key != slow_.key || saved->copy_worker.empty()) continue;
    next.state = State{};
    next.Happen(Restored{.runs = {*saved}, .attempt_next = 1000});
    next.Connect(1, saved->copy_worker, 1, {copy_});
    EXPECT_THAT(std::get<Welcome>(next.messages.back().content).go_on, ElementsAre(copy_));
    return;
  }
  FAIL() << "the second attempt is not on record";
}

/// Feeds the worker at `bad` with failures and the others with successes until nothing is leased or `rounds` are over.
void Work(CoreBench& bench, const std::set<ConnectionId>& bad, ConnectionId last, int rounds) {
  for (int round = 0; round < rounds; ++round) {
    for (ConnectionId c = 1; c <= last; ++c) {
      for (const Lease& lease : bench.TakeLeases(c)) bad.contains(c) ? bench.Fail(c, lease.id, Cause::kInternal) : bench.Succeed(c, lease.id);
    }
    bench.Pass(absl::Milliseconds(100));
  }
}

TEST(BadWorkers, OneThatFailsWhatOthersDoIsSetAsideAndComesBackOnProbation) {
  CoreBench bench;
  bench.Job("a", 200);
  for (ConnectionId c = 1; c <= 3; ++c) bench.Connect(c, fmt::format("w{}", c), 2);
  Work(bench, {1}, 3, 12);
  ASSERT_EQ(bench.state.set_aside.size(), 1u);
  const Worker& worker = bench.state.workers[bench.state.set_aside.begin()->second];
  EXPECT_EQ(worker.name, "w1");
  EXPECT_THAT(worker.health.reason, HasSubstr("different tasks"));
  EXPECT_TRUE(FindJob(bench.state, "a")->failed.empty()) << "it cost no task";
  bench.now += absl::Minutes(6);
  bench.Happen(Tick{});
  EXPECT_TRUE(bench.state.set_aside.empty());
  EXPECT_TRUE(worker.health.on_probation);
  EXPECT_LE(bench.TakeLeases(1).size(), 1u);
}

TEST(BadWorkers, WhenAllFailTheFaultIsNotTheirs) {
  CoreBench bench;
  bench.Job("a", 100);
  for (ConnectionId c = 1; c <= 3; ++c) bench.Connect(c, fmt::format("w{}", c), 2);
  Work(bench, {}, 3, 3);
  Work(bench, {1, 2, 3}, 3, 20);
  EXPECT_TRUE(bench.state.set_aside.empty());
}

TEST(BadWorkers, ABadFrameIsNotTheWorkers) {
  CoreBench bench;
  bench.Job("a", 100);
  for (ConnectionId c = 1; c <= 2; ++c) bench.Connect(c, fmt::format("w{}", c), 2);
  for (int round = 0; round < 5; ++round) {
    for (const Lease& lease : bench.TakeLeases(1)) bench.Fail(1, lease.id, Cause::kInput);
    for (const Lease& lease : bench.TakeLeases(2)) bench.Succeed(2, lease.id);
  }
  EXPECT_TRUE(bench.state.set_aside.empty());
}

}  // namespace
}  // namespace vorocast::core
