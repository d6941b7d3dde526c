// SPDX-License-Identifier: AGPL-3.0-or-later
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core_bench.h"

namespace vorocast::core {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

TEST(Core, FlowsInTheOrderOfThePlan) {
  CoreBench bench;
  bench.Job("j1", 2);
  bench.Connect(1, "w");
  std::vector<std::string> order;
  for (auto leases = bench.TakeLeases(1); !leases.empty(); leases = bench.TakeLeases(1)) {
    ASSERT_EQ(leases.size(), 1u);
    if (!leases[0].label.ends_with("sheet")) order.push_back(leases[0].label);  // those go whenever nothing better is ready
    bench.Succeed(1, leases[0].id);
  }
  EXPECT_THAT(order, ElementsAre("frame 0: tessellate", "frame 1: tessellate", "template", "guide", "window 0-1: track", "assemble"));
  EXPECT_EQ(PhaseOf(*FindJob(bench.state, "j1")), Phase::kDone);
  EXPECT_EQ(bench.Count<ResultMade>(), 9);
}

TEST(Core, TasksWithOneKeyRunOnceForAllJobs) {
  CoreBench bench;
  bench.Job("j1", 2);
  bench.Job("j2", 2, "bert");
  bench.Connect(1, "w", 10);
  const auto leases = bench.TakeLeases(1);
  EXPECT_EQ(leases.size(), 3u);  // two frames and the points sheet
  for (const Lease& lease : leases) bench.Succeed(1, lease.id);
  EXPECT_EQ(View(bench.state, *FindJob(bench.state, "j1")).stages[0].done, 2);
  EXPECT_EQ(View(bench.state, *FindJob(bench.state, "j2")).stages[0].done, 2);
  EXPECT_EQ(View(bench.state, *FindJob(bench.state, "j2")).stages[0].reused, 2);
}

TEST(Core, CancellingOneJobKeepsWhatAnotherWants) {
  CoreBench bench;
  bench.Job("j1", 2);
  bench.Job("j2", 2);
  bench.Connect(1, "w", 10);
  const auto leases = bench.TakeLeases(1);
  bench.messages.clear();
  bench.Happen(CancelJob{"j1"});
  EXPECT_TRUE(bench.messages.empty());
  bench.Happen(CancelJob{"j2"});
  EXPECT_EQ(bench.messages.size(), leases.size());
  for (const Message& message : bench.messages) EXPECT_TRUE(std::holds_alternative<Revoke>(message.content));
}

TEST(Core, LargerPriorityThenFewestLeasesThenOldestJob) {
  CoreBench bench;
  bench.Job("j1", 3, "anna", 0, 0);
  bench.Job("j2", 3, "bert", 0, 10);
  bench.Job("j3", 1, "cora", 5, 20);
  bench.Connect(1, "w", 5);
  EXPECT_THAT(bench.TakeLabels(1),
              ElementsAre("frame 20: tessellate", "points: sheet", "frame 0: tessellate", "frame 10: tessellate", "frame 1: tessellate"));
}

TEST(Core, AStaleReportIsAcknowledgedAndIgnored) {
  CoreBench bench;
  bench.Job("j1", 1);
  bench.Connect(1, "w1");
  const AttemptId first = bench.TakeLeases(1)[0].id;
  bench.Happen(WorkerDisconnected{1});
  bench.Pass(absl::Seconds(1));
  bench.Connect(2, "w2");
  const AttemptId second = bench.TakeLeases(2)[0].id;
  EXPECT_EQ(second.key, first.key);
  EXPECT_GT(second.attempt, first.attempt);
  bench.Connect(3, "w1", 1, {first});
  EXPECT_THAT(std::get<Welcome>(bench.messages[bench.messages.size() - 2].content).drop, ElementsAre(first));
  bench.messages.clear();
  bench.Succeed(3, first);
  EXPECT_EQ(bench.Count<ResultMade>(), 0);
  EXPECT_THAT(std::get<Acknowledge>(bench.messages[0].content).ids, ElementsAre(first));
}

TEST(Core, AWorkerThatComesBackInTimeGoesOn) {
  CoreBench bench;
  bench.Job("j1", 1);
  bench.Connect(1, "w");
  const AttemptId id = bench.TakeLeases(1)[0].id;
  bench.Happen(WorkerDisconnected{1});
  bench.Pass(absl::Milliseconds(500));
  bench.messages.clear();
  bench.Connect(2, "w", 1, {id});
  EXPECT_THAT(std::get<Welcome>(bench.messages[0].content).go_on, ElementsAre(id));
  bench.Happen(WorkerDisconnected{1});  // news of the old stream, late
  bench.Pass(absl::Seconds(5));
  bench.Succeed(2, id);
  EXPECT_EQ(bench.Count<ResultMade>(), 1);
}

TEST(Core, AHangingWorkerLosesItsLeaseAfterTenSecondsAndGetsNoOther) {
  CoreBench bench;
  bench.Job("j1", 1);
  bench.Connect(1, "w");
  const AttemptId id = bench.TakeLeases(1)[0].id;
  bench.Pass(absl::Seconds(9));
  bench.Happen(Heartbeat{1, {{id, 0.25}}});
  EXPECT_THAT(bench.Explained("j1", "frame 0: tessellate"), HasSubstr("25 % done"));
  bench.Pass(absl::Seconds(9));
  EXPECT_TRUE(std::holds_alternative<Leased>(bench.state.runs[bench.state.run_by_key.at(id.key)].state));
  bench.Pass(absl::Seconds(2));
  EXPECT_TRUE(bench.TakeLeases(1).empty());
  bench.Happen(Heartbeat{1, {}});
  EXPECT_EQ(bench.TakeLeases(1).size(), 1u);
}

TEST(Core, CausesDecideAboutTheNextAttempt) {
  const std::vector<std::pair<Cause, int>> attempts = {{Cause::kInput, 1},    {Cause::kCrashed, 3},     {Cause::kTimedOut, 2},
                                                       {Cause::kInternal, 3}, {Cause::kOutOfMemory, 2}, {Cause::kDrained, 11}};
  for (const auto& [cause, expected] : attempts) {
    CoreBench bench;
    bench.Job("j1", 1);
    bench.Connect(1, "w");
    int made = 0;
    std::int64_t memory = 0;
    absl::Duration time;
    while (std::holds_alternative<Wanted>(bench.state.tasks[0].state)) {
      const auto leases = bench.TakeLeases(1);
      ASSERT_FALSE(leases.empty());
      if (leases[0].label != "frame 0: tessellate") {
        bench.Succeed(1, leases[0].id);
        continue;
      }
      ++made;
      if (cause == Cause::kOutOfMemory && made == 2) {
        EXPECT_EQ(leases[0].memory_limit, 2 * memory);
      }
      if (cause == Cause::kTimedOut && made == 2) {
        EXPECT_EQ(leases[0].time_limit, 2 * time);
      }
      memory = leases[0].memory_limit;
      time = leases[0].time_limit;
      bench.Fail(1, leases[0].id, cause);
    }
    EXPECT_EQ(made, expected) << Name(cause);
    EXPECT_THAT(bench.Explained("j1", "frame 0: tessellate"), HasSubstr("failed"));
  }
}

TEST(Core, AnUnreachableStoreIsGivenTime) {
  CoreBench bench;
  bench.Job("j1", 1);
  bench.Connect(1, "w");
  bench.Fail(1, bench.TakeLeases(1)[0].id, Cause::kStore);
  EXPECT_THAT(bench.TakeLabels(1), ElementsAre("points: sheet"));
  EXPECT_THAT(bench.Explained("j1", "frame 0: tessellate"), HasSubstr("waits a moment"));
}

TEST(Core, ABadFrameBecomesAMissingInput) {
  CoreBench bench;
  bench.Job("j1", 3);
  bench.Connect(1, "w");
  bool guide_saw_gap = false;
  for (auto leases = bench.TakeLeases(1); !leases.empty(); leases = bench.TakeLeases(1)) {
    const Lease& lease = leases[0];
    if (lease.label == "guide") {
      const auto spec = nlohmann::json::parse(lease.spec_json);
      guide_saw_gap = spec["inputs"][2]["frame"] == 1 && spec["inputs"][2]["digest"].is_null() && !spec["inputs"][1]["digest"].is_null();
    }
    lease.label == "frame 1: tessellate" ? bench.Fail(1, lease.id, Cause::kInput) : bench.Succeed(1, lease.id);
  }
  EXPECT_TRUE(guide_saw_gap);
  EXPECT_EQ(PhaseOf(*FindJob(bench.state, "j1")), Phase::kDone);
  EXPECT_EQ(View(bench.state, *FindJob(bench.state, "j1")).failures.size(), 1u);
}

TEST(Core, WhatNeedsAFailedTaskFailsWithIt) {
  CoreBench bench;
  bench.Job("j1", 2);
  bench.Connect(1, "w");
  for (auto leases = bench.TakeLeases(1); !leases.empty(); leases = bench.TakeLeases(1)) {
    leases[0].label == "template" ? bench.Fail(1, leases[0].id, Cause::kInput) : bench.Succeed(1, leases[0].id);
  }
  EXPECT_EQ(PhaseOf(*FindJob(bench.state, "j1")), Phase::kFailed);
  EXPECT_THAT(bench.Explained("j1", "assemble"), HasSubstr("needs"));
  EXPECT_EQ(View(bench.state, *FindJob(bench.state, "j1")).failures.size(), 1u);  // the root only
  bench.Happen(RetryJob{"j1"});
  EXPECT_THAT(bench.TakeLabels(1), ElementsAre("template"));
}

TEST(Core, ARetryOfAJobThatIsOverMakesLostResultsAgain) {
  CoreBench bench;
  bench.Job("j1", 2);
  bench.Connect(1, "w");
  for (auto leases = bench.TakeLeases(1); !leases.empty(); leases = bench.TakeLeases(1)) bench.Succeed(1, leases[0].id);
  ASSERT_EQ(PhaseOf(*FindJob(bench.state, "j1")), Phase::kDone);
  EXPECT_EQ(bench.verified, 0);
  const auto key = std::get<Done>(bench.state.tasks[FindJob(bench.state, "j1")->by_name.at("frame 1: tessellate")].state).key;
  bench.results.erase(key);
  bench.Happen(RetryJob{"j1"});
  EXPECT_GT(bench.verified, 0);
  EXPECT_THAT(bench.TakeLabels(1), ElementsAre("frame 1: tessellate"));
  EXPECT_EQ(View(bench.state, *FindJob(bench.state, "j1")).stages[0].done, 1);
}

TEST(Core, AForgottenJobLeavesNothingBehindAndItsResultsAreReused) {
  CoreBench bench;
  bench.Job("j1", 2);
  bench.Happen(JobForgotten{"j1"});
  EXPECT_TRUE(FindJob(bench.state, "j1")) << "it is not over";
  bench.Connect(1, "w");
  for (auto leases = bench.TakeLeases(1); !leases.empty(); leases = bench.TakeLeases(1)) bench.Succeed(1, leases[0].id);
  bench.Happen(JobForgotten{"j1"});
  EXPECT_FALSE(FindJob(bench.state, "j1"));
  for (TaskIndex task = 0; task < bench.state.tasks.size(); ++task) EXPECT_TRUE(bench.state.tasks[task].inputs.empty());
  bench.Job("j2", 2);
  EXPECT_TRUE(bench.TakeLeases(1).empty());
  EXPECT_EQ(PhaseOf(*FindJob(bench.state, "j2")), Phase::kDone);
}

TEST(Core, AStoppedSchedulerDoesNotBlameItsWorkers) {
  CoreBench bench;
  bench.Job("j1", 1);
  bench.Connect(1, "w");
  const AttemptId id = bench.TakeLeases(1)[0].id;
  bench.Pass(absl::Seconds(1));
  bench.now += absl::Minutes(5);
  bench.Happen(Tick{});
  bench.Succeed(1, id);
  EXPECT_EQ(bench.Count<ResultMade>(), 1);
}

TEST(Core, SaysWhyATaskWaits) {
  CoreBench bench;
  bench.Job("j1", 2);
  EXPECT_THAT(bench.Explained("j1", "frame 0: tessellate"), HasSubstr("none is connected"));
  EXPECT_THAT(bench.Explained("j1", "j1/guide"), HasSubstr("waits for 3 tasks"));
  bench.Connect(1, "w");
  EXPECT_THAT(bench.Explained("j1", "frame 0: tessellate"), HasSubstr("runs on worker w"));
  EXPECT_THAT(bench.Explained("j1", "frame 1: tessellate"), HasSubstr("waits its turn"));
  EXPECT_EQ(Explain(bench.state, *FindJob(bench.state, "j1"), "frame 9: tessellate").status().code(), absl::StatusCode::kNotFound);
  bench.Happen(CancelJob{"j1"});
  EXPECT_THAT(bench.Explained("j1", "guide"), HasSubstr("cancelled"));
}

}  // namespace
}  // namespace vorocast::core
