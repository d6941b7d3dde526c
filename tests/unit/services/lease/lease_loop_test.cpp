// SPDX-License-Identifier: AGPL-3.0-or-later
#include "services/lease/lease_loop.h"

#include <signal.h>
#include <spawn.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <fstream>
#include <thread>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include "services/tasks/options.h"
#include "tests/unit/services/lease/fake_scheduler.h"
#include "tests/unit/services/storage/temporary_folder.h"

namespace vorocast::lease {
namespace {

using nlohmann::json;
using ::testing::HasSubstr;

tasks::TaskSpec Simulation(const json& effect) { return {tasks::Kind::kSimulate, ToJson(tasks::SimulateOptions{effect}), {}}; }

v1::Lease LeaseOf(const json& effect, std::int64_t attempt = 1) {
  const tasks::TaskSpec spec = Simulation(effect);
  v1::Lease lease;
  lease.mutable_id()->set_task_id(spec.Key().Hex());
  lease.mutable_id()->set_attempt(attempt);
  lease.set_label("test: simulate");
  lease.set_spec_json(ToJson(spec).dump());
  lease.set_memory_limit(std::int64_t{1} << 30);
  lease.set_time_limit_s(60);
  return lease;
}

/// The other end of a pipe on which a hanging child has said that it lives, and which ends when it dies.
class ChildOnPipe {
 public:
  explicit ChildOnPipe(const std::string& path) : pipe_(path) {
    std::string line;
    std::getline(pipe_, line);
    EXPECT_EQ(line, "alive");
  }
  void AwaitDeath() { EXPECT_EQ(pipe_.get(), std::ifstream::traits_type::eof()); }

 private:
  std::ifstream pipe_;
};

/// A worker loop in this process against a fake scheduler.
class LeaseLoopTest : public ::testing::Test {
 protected:
  void StartWorker(std::int32_t slots = 1, absl::Duration drain_time = absl::Seconds(30)) {
    const LeaseLoopOptions options{.scheduler = address_,
                                   .slots = slots,
                                   .program = std::filesystem::read_symlink("/proc/self/exe"),
                                   .name = "worker under test",
                                   .heartbeat = absl::Milliseconds(50),
                                   .drain_time = drain_time};
    worker_ = std::thread([this, options] { worker_status_ = RunLeaseLoop(options, {tasks::Kind::kSimulate}); });
    hello_ = scheduler_->AwaitHello();
    ASSERT_EQ(hello_.worker(), "worker under test");
    scheduler_->Welcome(root());
  }
  void TearDown() override {
    if (!worker_.joinable()) return;
    ::kill(::getpid(), SIGTERM);
    ::kill(::getpid(), SIGTERM);  // the second time it does not wait for what runs
    worker_.join();
  }
  /// Lets the loop end as drained and returns its status.
  absl::Status Drain() {
    ::kill(::getpid(), SIGTERM);
    worker_.join();
    return worker_status_;
  }

  void Send(const v1::Lease& lease) {
    v1::SchedulerMessage message;
    *message.mutable_leases()->add_leases() = lease;
    scheduler_->Send(message);
  }
  /// Leases, awaits the end and acknowledges it.
  v1::Finished RunToEnd(const v1::Lease& lease) {
    Send(lease);
    v1::Finished finished = scheduler_->AwaitFinished();
    EXPECT_EQ(finished.id().task_id(), lease.id().task_id());
    EXPECT_EQ(finished.id().attempt(), lease.id().attempt());
    scheduler_->Acknowledge(finished.id());
    return finished;
  }

  std::string root() const { return (folder_ / "store").string(); }
  std::string MakePipe(const std::string& name) const {
    const std::string path = (folder_ / name).string();
    EXPECT_EQ(::mkfifo(path.c_str(), 0600), 0);
    return path;
  }
  bool NoTemporariesLeft() const { return std::filesystem::is_empty(folder_ / "store" / "tmp"); }

  TemporaryFolder folder_;
  std::string address_ = "unix:" + (folder_ / "socket").string();
  std::unique_ptr<FakeScheduler> scheduler_ = std::make_unique<FakeScheduler>(address_);
  v1::Hello hello_;
  std::thread worker_;
  absl::Status worker_status_;
};

TEST_F(LeaseLoopTest, SaysWhoItIs) {
  StartWorker(3);
  EXPECT_EQ(hello_.slots(), 3);
  ASSERT_EQ(hello_.kinds_size(), 1);
  EXPECT_EQ(hello_.kinds(0), "simulate");
  EXPECT_EQ(hello_.holding_size(), 0);
}

TEST_F(LeaseLoopTest, PublishesTheResultBeforeItSaysSo) {
  StartWorker();
  const v1::Finished finished = RunToEnd(LeaseOf({{"do", "write"}}));
  ASSERT_TRUE(finished.has_succeeded()) << finished.failed().message();
  const auto store = storage::ArtifactStore::Open(root()).value();
  const auto path = store.ArtifactPath(Simulation({{"do", "write"}}).Key(), ".h5");
  EXPECT_EQ(finished.succeeded().sha256(), base::HashFile(path)->Hex());
  EXPECT_EQ(finished.succeeded().size(), static_cast<std::int64_t>(std::filesystem::file_size(path)));
  EXPECT_GT(finished.succeeded().seconds(), 0);
  EXPECT_GT(finished.succeeded().cpu_seconds(), 0);
  EXPECT_GT(finished.succeeded().memory_peak(), 1 << 20);
  EXPECT_TRUE(NoTemporariesLeft());
  EXPECT_EQ(Drain(), absl::OkStatus());
}

TEST_F(LeaseLoopTest, WhatExistsIsNotMadeAgain) {
  StartWorker();
  const auto store = storage::ArtifactStore::Open(root()).value();
  const auto made_before = store.TemporaryPath(".h5");
  std::ofstream(made_before) << "made before";
  ASSERT_EQ(store.PublishArtifact(made_before, Simulation({{"do", "crash"}}).Key(), ".h5"), absl::OkStatus());
  const v1::Finished finished = RunToEnd(LeaseOf({{"do", "crash"}}));
  ASSERT_TRUE(finished.has_succeeded());
  EXPECT_EQ(finished.succeeded().sha256(), base::HashBytes("made before").Hex());
}

TEST_F(LeaseLoopTest, SortsTheCausesOfFailure) {
  StartWorker();
  const v1::Finished input = RunToEnd(LeaseOf({{"do", "refuse"}}));
  EXPECT_EQ(input.failed().cause(), v1::Failed::INPUT);
  EXPECT_EQ(input.failed().message(), "3 of 65386 normals are not finite");

  const v1::Finished crash = RunToEnd(LeaseOf({{"do", "crash"}}));
  EXPECT_EQ(crash.failed().cause(), v1::Failed::CRASHED);
  EXPECT_THAT(crash.failed().message(), HasSubstr("SIGSEGV"));
  EXPECT_THAT(crash.failed().message(), HasSubstr("the last words"));

  const v1::Finished store = RunToEnd(LeaseOf({{"do", "lose the store"}}));
  EXPECT_EQ(store.failed().cause(), v1::Failed::STORE);

  const v1::Finished thrown = RunToEnd(LeaseOf({{"do", "throw"}}));
  EXPECT_EQ(thrown.failed().cause(), v1::Failed::INTERNAL);
  EXPECT_THAT(thrown.failed().message(), HasSubstr("a library threw"));

  const v1::Finished nonsense = RunToEnd(LeaseOf({{"do", "write nonsense"}}));
  EXPECT_EQ(nonsense.failed().cause(), v1::Failed::INTERNAL);
  EXPECT_THAT(nonsense.failed().message(), HasSubstr("cannot be read back"));

  v1::Lease malformed = LeaseOf({{"do", "write"}});
  malformed.set_spec_json("{\"kind\": \"simulate\"}");
  EXPECT_EQ(RunToEnd(malformed).failed().cause(), v1::Failed::INPUT);
  EXPECT_TRUE(NoTemporariesLeft());
}

TEST_F(LeaseLoopTest, WhatALibraryPrintsIsNotTakenForTheOutcome) {
  StartWorker();
  EXPECT_TRUE(RunToEnd(LeaseOf({{"do", "chatter"}})).has_succeeded());
}

TEST_F(LeaseLoopTest, ATaskThatWantsTooMuchMemoryIsStopped) {
  StartWorker();
  v1::Lease lease = LeaseOf({{"do", "eat memory"}});
  lease.set_memory_limit(256 << 20);
  const v1::Finished finished = RunToEnd(lease);
  EXPECT_EQ(finished.failed().cause(), v1::Failed::OUT_OF_MEMORY) << finished.failed().message();
  EXPECT_THAT(finished.failed().message(), HasSubstr("256 MiB"));
}

TEST_F(LeaseLoopTest, ATaskThatTakesTooLongIsStopped) {
  StartWorker();
  v1::Lease lease = LeaseOf({{"do", "wait"}, {"pipe", MakePipe("never")}});
  lease.set_time_limit_s(0.2);
  const v1::Finished finished = RunToEnd(lease);
  EXPECT_EQ(finished.failed().cause(), v1::Failed::TIMED_OUT);
  EXPECT_TRUE(NoTemporariesLeft());
}

TEST_F(LeaseLoopTest, WhatAnAttemptPrintedGoesAlong) {
  StartWorker();
  const v1::Finished silent = RunToEnd(LeaseOf({{"do", "write"}}));
  EXPECT_EQ(silent.log(), "");
  const v1::Finished crash = RunToEnd(LeaseOf({{"do", "crash"}}));
  EXPECT_THAT(crash.log(), HasSubstr("the last words"));
  EXPECT_GT(crash.failed().memory_peak(), 1 << 20);
  const v1::Finished much = RunToEnd(LeaseOf({{"do", "print a lot"}}));
  EXPECT_LE(much.log().size(), std::size_t{64} << 10);
  EXPECT_GT(much.log().size(), std::size_t{60} << 10);
  EXPECT_TRUE(much.log().ends_with("line 99999\n\uFFFD the last words")) << much.log().substr(much.log().size() - 100);
}

TEST_F(LeaseLoopTest, HeartbeatsCarryProgress) {
  StartWorker();
  const std::string pipe = MakePipe("pipe");
  const v1::Lease lease = LeaseOf({{"do", "wait"}, {"pipe", pipe}});
  Send(lease);
  const auto heartbeat = scheduler_->Await([&](const v1::WorkerMessage& m) {
    return m.heartbeat().progress_size() == 1 && m.heartbeat().progress(0).fraction() == 0.5 &&
           m.heartbeat().progress(0).id().task_id() == lease.id().task_id();
  });
  EXPECT_TRUE(heartbeat.has_value());
  std::ofstream(pipe) << 'x';
  const v1::Finished finished = scheduler_->AwaitFinished();
  EXPECT_TRUE(finished.has_succeeded());
  scheduler_->Acknowledge(finished.id());
}

TEST_F(LeaseLoopTest, ARevokedTaskIsKilledAndItsSlotIsFree) {
  StartWorker(1);
  const std::string pipe = MakePipe("pipe");
  const v1::Lease unwanted = LeaseOf({{"do", "hang"}, {"pipe", pipe}});
  Send(unwanted);
  ChildOnPipe child(pipe);
  Send(LeaseOf({{"do", "write"}}));  // waits for the slot
  scheduler_->Revoke(unwanted.id());
  child.AwaitDeath();
  const v1::Finished finished = scheduler_->AwaitFinished();
  EXPECT_NE(finished.id().task_id(), unwanted.id().task_id());
  EXPECT_TRUE(finished.has_succeeded());
  scheduler_->Acknowledge(finished.id());
  EXPECT_TRUE(NoTemporariesLeft());
}

TEST_F(LeaseLoopTest, GoesOnThroughTheSchedulersDeath) {
  StartWorker();
  const std::string pipe = MakePipe("pipe");
  const v1::Lease lease = LeaseOf({{"do", "wait"}, {"pipe", pipe}}, 7);
  Send(lease);
  scheduler_->Await([](const v1::WorkerMessage& m) { return m.heartbeat().progress_size() == 1; });
  scheduler_.reset();
  std::ofstream(pipe) << 'x';  // the task goes on, and may end, with no scheduler there

  scheduler_ = std::make_unique<FakeScheduler>(address_);
  const v1::Hello hello = scheduler_->AwaitHello();
  EXPECT_EQ(hello.worker(), "worker under test");
  ASSERT_EQ(hello.holding_size(), 1);
  EXPECT_EQ(hello.holding(0).task_id(), lease.id().task_id());
  EXPECT_EQ(hello.holding(0).attempt(), 7);
  scheduler_->Welcome(root(), {lease.id()});
  EXPECT_TRUE(scheduler_->AwaitFinished().has_succeeded());

  // The report was not acknowledged before the next death, so it comes again.
  scheduler_.reset();
  scheduler_ = std::make_unique<FakeScheduler>(address_);
  ASSERT_EQ(scheduler_->AwaitHello().holding_size(), 1);
  scheduler_->Welcome(root(), {lease.id()});
  const v1::Finished again = scheduler_->AwaitFinished();
  EXPECT_TRUE(again.has_succeeded());
  EXPECT_EQ(again.id().attempt(), 7);
  scheduler_->Acknowledge(again.id());
  EXPECT_EQ(Drain(), absl::OkStatus());
}

TEST_F(LeaseLoopTest, DropsWhatTheSchedulerDoesNotKnowAnyMore) {
  StartWorker();
  const std::string pipe = MakePipe("pipe");
  const v1::Lease lease = LeaseOf({{"do", "hang"}, {"pipe", pipe}});
  Send(lease);
  ChildOnPipe child(pipe);
  scheduler_.reset();
  scheduler_ = std::make_unique<FakeScheduler>(address_);
  ASSERT_EQ(scheduler_->AwaitHello().holding_size(), 1);
  scheduler_->Welcome(root(), {}, {lease.id()});
  child.AwaitDeath();
  EXPECT_TRUE(RunToEnd(LeaseOf({{"do", "write"}})).has_succeeded());
}

TEST_F(LeaseLoopTest, DrainingFinishesWhatRuns) {
  StartWorker();
  const std::string pipe = MakePipe("pipe");
  Send(LeaseOf({{"do", "wait"}, {"pipe", pipe}}));
  scheduler_->Await([](const v1::WorkerMessage& m) { return m.heartbeat().progress_size() == 1; });
  ::kill(::getpid(), SIGTERM);
  EXPECT_TRUE(scheduler_->Await([](const v1::WorkerMessage& m) { return m.has_leaving(); }).has_value());
  // A lease that was on its way is given back at once.
  Send(LeaseOf({{"do", "write"}}));
  const v1::Finished refused = scheduler_->AwaitFinished();
  EXPECT_EQ(refused.failed().cause(), v1::Failed::DRAINED);
  scheduler_->Acknowledge(refused.id());
  std::ofstream(pipe) << 'x';
  const v1::Finished finished = scheduler_->AwaitFinished();
  EXPECT_TRUE(finished.has_succeeded());
  scheduler_->Acknowledge(finished.id());
  worker_.join();
  EXPECT_EQ(worker_status_, absl::OkStatus());
}

TEST_F(LeaseLoopTest, DrainingGivesBackWhatDoesNotEndInTime) {
  StartWorker(1, absl::Milliseconds(100));
  const std::string pipe = MakePipe("pipe");
  Send(LeaseOf({{"do", "hang"}, {"pipe", pipe}}));
  ChildOnPipe child(pipe);
  ::kill(::getpid(), SIGTERM);
  const v1::Finished finished = scheduler_->AwaitFinished();
  EXPECT_EQ(finished.failed().cause(), v1::Failed::DRAINED);
  scheduler_->Acknowledge(finished.id());
  worker_.join();
  EXPECT_EQ(worker_status_, absl::OkStatus());
  EXPECT_TRUE(NoTemporariesLeft());
}

TEST_F(LeaseLoopTest, ATaskDiesWithItsWorker) {
  const std::string program = std::filesystem::read_symlink("/proc/self/exe").string();
  std::string command = "run-worker";
  char* const arguments[] = {const_cast<char*>(program.c_str()), command.data(), address_.data(), nullptr};
  pid_t worker = 0;
  ASSERT_EQ(::posix_spawn(&worker, program.c_str(), nullptr, nullptr, arguments, environ), 0);
  scheduler_->AwaitHello();
  scheduler_->Welcome(root());
  const std::string pipe = MakePipe("pipe");
  Send(LeaseOf({{"do", "hang"}, {"pipe", pipe}}));
  ChildOnPipe child(pipe);
  ::kill(worker, SIGKILL);
  ASSERT_EQ(::waitpid(worker, nullptr, 0), worker);
  child.AwaitDeath();
}

TEST(RunLeaseLoop, RefusesOptionsThatCannotWork) {
  EXPECT_EQ(RunLeaseLoop({.scheduler = "", .program = "/bin/true"}, {}).code(), absl::StatusCode::kInvalidArgument);
  EXPECT_EQ(RunLeaseLoop({.scheduler = "localhost:1", .slots = 0, .program = "/bin/true"}, {}).code(), absl::StatusCode::kInvalidArgument);
  EXPECT_EQ(RunLeaseLoop({.scheduler = "localhost:1", .program = "/nowhere"}, {}).code(), absl::StatusCode::kInvalidArgument);
}

}  // namespace
}  // namespace vorocast::lease
