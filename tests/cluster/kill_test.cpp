// SPDX-License-Identifier: AGPL-3.0-or-later
// A job must end with the results of an undisturbed run, and compute nothing twice that had finished, whoever is killed on the way.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <signal.h>

#include "tests/cluster/programs.h"
#include "tests/cluster/small_job.h"

namespace vorocast::cluster {
namespace {

using testing::AllOf;
using testing::Each;
using testing::IsEmpty;
using testing::Not;
using testing::Pair;

struct Killed {
  std::filesystem::path folder;
  std::filesystem::path state() const { return folder / "state"; }
  std::filesystem::path artifacts() const { return folder / "state" / "artifacts"; }
};

void ExpectUndisturbedResults(const Killed& run) {
  EXPECT_EQ(Digests(run.folder / "out"), UndisturbedDigests());
  EXPECT_THAT(FinishedTasks(run.state()), AllOf(Not(IsEmpty()), Each(Pair(testing::_, 1))));
}

/// Some results are there, and more are to come.
bool MidJob(const Killed& run) { return CountFiles(run.artifacts()) >= 3; }

TEST(Kill, AWorkerInTheMiddleOfATask) {
  const Killed run{Scratch() / "worker"};
  ASSERT_FALSE(UndisturbedDigests().empty());
  Running job(RunArguments(run.folder));
  pid_t worker = -1;
  ASSERT_TRUE(Eventually([&] {
    worker = MemberPid(run.state(), "worker-1");
    return MidJob(run) && ChildOf(worker) > 0;
  }));
  const pid_t child = ChildOf(worker);
  kill(worker, SIGKILL);
  EXPECT_TRUE(Eventually([&] { return !Alive(child); }, 10)) << "the task's process outlived its worker";
  const Outcome outcome = job.Wait();
  EXPECT_EQ(outcome.exit_code, 0) << outcome.output;
  ExpectUndisturbedResults(run);
}

TEST(Kill, ATasksOwnProcess) {
  const Killed run{Scratch() / "child"};
  Running job(RunArguments(run.folder));
  pid_t child = -1;
  ASSERT_TRUE(Eventually([&] {
    child = ChildOf(MemberPid(run.state(), "worker-2"));
    return MidJob(run) && child > 0;
  }));
  kill(child, SIGKILL);
  const Outcome outcome = job.Wait();
  EXPECT_EQ(outcome.exit_code, 0) << outcome.output;
  ExpectUndisturbedResults(run);
}

TEST(Kill, TheSchedulerInTheMiddleOfAJob) {
  const Killed run{Scratch() / "scheduler"};
  Running job(RunArguments(run.folder));
  ASSERT_TRUE(Eventually([&] { return MidJob(run); }));
  const pid_t scheduler = SchedulerPid(run.state());
  const pid_t worker = MemberPid(run.state(), "worker-1");
  ASSERT_GT(scheduler, 0);
  kill(scheduler, SIGKILL);
  ASSERT_TRUE(Eventually([&] { return SchedulerPid(run.state()) != scheduler && Alive(SchedulerPid(run.state())); })) << "nobody started it again";
  EXPECT_EQ(MemberPid(run.state(), "worker-1"), worker) << "the worker was replaced instead of taken back";
  const Outcome outcome = job.Wait();
  EXPECT_EQ(outcome.exit_code, 0) << outcome.output;
  ExpectUndisturbedResults(run);
}

TEST(Kill, TheClientAndTheSameCommandGoesOn) {
  const Killed run{Scratch() / "client"};
  Running job(RunArguments(run.folder));
  ASSERT_TRUE(Eventually([&] { return MidJob(run); }));
  job.Signal(SIGKILL);
  (void)job.Wait();
  const pid_t scheduler = SchedulerPid(run.state());
  EXPECT_TRUE(Eventually([&] { return !Alive(scheduler); }, 60)) << "the scheduler outlived the client that had started it";
  const Outcome outcome = RunProgram(RunArguments(run.folder));
  EXPECT_EQ(outcome.exit_code, 0) << outcome.output;
  ExpectUndisturbedResults(run);
}

TEST(Kill, CtrlCStopsInGoodOrderAndTheSameCommandGoesOn) {
  const Killed run{Scratch() / "interrupt"};
  Running job(RunArguments(run.folder));
  ASSERT_TRUE(Eventually([&] { return MidJob(run); }));
  const pid_t scheduler = SchedulerPid(run.state());
  const pid_t worker = MemberPid(run.state(), "worker-1");
  job.Signal(SIGINT);
  const Outcome stopped = job.Wait();
  EXPECT_EQ(stopped.exit_code, 1);
  EXPECT_THAT(stopped.output, testing::HasSubstr("the same command goes on from here"));
  EXPECT_FALSE(Alive(scheduler));
  EXPECT_FALSE(Alive(worker));
  const Outcome outcome = RunProgram(RunArguments(run.folder));
  EXPECT_EQ(outcome.exit_code, 0) << outcome.output;
  ExpectUndisturbedResults(run);
}

}  // namespace
}  // namespace vorocast::cluster
