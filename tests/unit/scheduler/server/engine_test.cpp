// SPDX-License-Identifier: AGPL-3.0-or-later
// What the engine does when its store cannot be written, and when it must not be written any more.
#include "scheduler/server/engine.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <atomic>
#include <future>
#include <memory>
#include <mutex>
#include <thread>

#include "services/base/status.h"

namespace vorocast::server {
namespace {

using testing::HasSubstr;

/// Remembers nothing; fails as told.
class FailingStore final : public store::Store {
 public:
  absl::StatusOr<std::int64_t> Lead(const std::string&) override { return 1; }
  std::string LeaderAddress() override { return {}; }
  absl::Status KeepLeading() override { return absl::OkStatus(); }
  absl::StatusOr<store::Snapshot> Load() override { return store::Snapshot{}; }
  absl::Status Append(const std::vector<store::Record>& records) override {
    const std::lock_guard lock(mutex_);
    ++attempts;
    if (fails_.ok()) written += static_cast<int>(records.size());
    return fails_;
  }
  std::int64_t term() const override { return 1; }
  absl::StatusOr<std::vector<core::AttemptEnded>> FindAttempts(const store::AttemptQuery&) override { return std::vector<core::AttemptEnded>{}; }
  absl::StatusOr<std::optional<core::Result>> FindResult(const base::Digest&) override { return std::nullopt; }
  absl::StatusOr<std::string> FindJobText(const std::string&, store::JobText) override { return absl::NotFoundError(""); }
  absl::StatusOr<std::vector<store::FrameAdded>> LoadFrames(const std::string&) override { return std::vector<store::FrameAdded>(); }

  void Fail(absl::Status status) {
    const std::lock_guard lock(mutex_);
    fails_ = std::move(status);
  }
  std::atomic<int> attempts = 0;
  std::atomic<int> written = 0;

 private:
  std::mutex mutex_;
  absl::Status fails_;  // guarded by mutex_
};

class EngineTest : public testing::Test {
 protected:
  void SetUp() override {
    engine_.Start({.send = [](core::Message) {},
                   .look_up = [](std::vector<core::LookUp>) {},
                   .changed = [](Turn&, const std::set<std::string>&) {},
                   .stalled = [this](const absl::Status&) { ++stalls_; }});
  }
  /// A call that writes something; its answer.
  absl::Status Write() {
    auto answer = std::make_shared<std::promise<absl::Status>>();
    const absl::Status accepted = engine_.Ask([answer](Turn& turn) {
      turn.Record(store::SequenceClosed{"s1"});
      turn.Answer([answer](const absl::Status& durable) { answer->set_value(durable); });
    });
    return accepted.ok() ? answer->get_future().get() : accepted;
  }

  FailingStore store_;
  std::promise<absl::Status> lost_;
  Engine engine_{store_, [this](const absl::Status& why) { lost_.set_value(why); }};
  std::atomic<int> stalls_ = 0;
};

TEST_F(EngineTest, AFullDiskIsToldAtOnceAndWorkGoesOnWhenThereIsRoom) {
  EXPECT_TRUE(Write().ok());
  store_.Fail(absl::ResourceExhaustedError("database or disk is full"));
  const absl::Status first = Write();
  EXPECT_EQ(first.code(), absl::StatusCode::kResourceExhausted);
  EXPECT_THAT(std::string(first.message()), HasSubstr("disk is full"));
  // Who asks later is not kept waiting either.
  EXPECT_EQ(Write(), first);
  EXPECT_EQ(stalls_, 1);
  const int before = store_.attempts;
  store_.Fail(absl::OkStatus());
  // What was refused to be answered is written all the same, as it is in memory already.
  while (store_.written < 2) std::this_thread::yield();
  EXPECT_GT(store_.attempts, before);
  while (!Write().ok()) std::this_thread::yield();
  EXPECT_EQ(stalls_, 1);
}

TEST_F(EngineTest, AnEngineThatIsStoppedWhileItsStoreIsAwayEnds) {
  store_.Fail(absl::UnavailableError("connection refused"));
  EXPECT_EQ(Write().code(), absl::StatusCode::kUnavailable);
  engine_.Stop();
  EXPECT_EQ(store_.written, 0);
}

TEST_F(EngineTest, WhoIsFencedWritesNothingMoreAndSaysSo) {
  store_.Fail(absl::FailedPreconditionError("another scheduler leads under term 2"));
  EXPECT_EQ(Write().code(), absl::StatusCode::kFailedPrecondition);
  EXPECT_THAT(std::string(lost_.get_future().get().message()), HasSubstr("term 2"));
  store_.Fail(absl::OkStatus());
  EXPECT_FALSE(Write().ok());
  EXPECT_EQ(store_.written, 0);
}

}  // namespace
}  // namespace vorocast::server
