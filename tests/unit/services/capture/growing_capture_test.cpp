// SPDX-License-Identifier: AGPL-3.0-or-later
#include "services/capture/growing_capture.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <set>

namespace vorocast::capture {
namespace {

using std::chrono::milliseconds;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

/// A folder on a clock of its own.
class GrowingCaptureTest : public testing::Test {
 protected:
  /// The numbers that become whole after so many milliseconds.
  std::vector<int> After(int passed) {
    now_ += milliseconds(passed);
    const auto frames = capture_.Next(files_, now_);
    EXPECT_TRUE(frames.ok()) << frames.status();
    std::vector<int> numbers;
    if (frames.ok()) {
      for (const CaptureFrame& frame : *frames) numbers.push_back(frame.number);
    }
    return numbers;
  }
  void Append(const std::string& name, std::uint64_t size) { files_.push_back({{static_cast<int>(files_.size()), name}, size, {}}); }
  void Grow(std::size_t index, std::uint64_t size) { files_[index].size = size; }

  std::set<std::string> unreadable_;
  GrowingCapture capture_{{.settle = milliseconds(1000)}, [this](const std::filesystem::path& path) { return !unreadable_.contains(path.string()); }};
  std::vector<FrameFile> files_;
  GrowingCapture::Time now_{};
};

TEST_F(GrowingCaptureTest, AFrameLeavesOnceWhenItsFileHasSettled) {
  EXPECT_THAT(After(0), IsEmpty());
  Append("a", 100);
  EXPECT_THAT(After(500), IsEmpty());
  EXPECT_THAT(After(999), IsEmpty());
  EXPECT_THAT(After(1), ElementsAre(0));
  EXPECT_THAT(After(5000), IsEmpty());
  EXPECT_EQ(capture_.left_count(), 1U);
}

TEST_F(GrowingCaptureTest, AFileThatGrowsWaitsForItsEnd) {
  Append("a", 100);
  EXPECT_THAT(After(0), IsEmpty());
  for (int i = 1; i < 20; ++i) {
    Grow(0, 100 + static_cast<std::uint64_t>(i));
    EXPECT_THAT(After(900), IsEmpty());
  }
  EXPECT_EQ(capture_.last_change(), now_);
  EXPECT_THAT(After(1000), ElementsAre(0));
}

TEST_F(GrowingCaptureTest, FramesLeaveInTheirOrder) {
  Append("a", 100);
  Append("b", 100);
  EXPECT_THAT(After(0), IsEmpty());
  Grow(0, 200);  // b has settled first
  EXPECT_THAT(After(999), IsEmpty());
  EXPECT_THAT(After(1), IsEmpty());
  EXPECT_THAT(After(999), ElementsAre(0, 1));
}

TEST_F(GrowingCaptureTest, WhatCannotBeReadIsGivenMoreTimeAndThenLeavesAllTheSame) {
  unreadable_ = {"a"};
  Append("a", 100);
  EXPECT_THAT(After(0), IsEmpty());
  EXPECT_THAT(After(9999), IsEmpty());
  EXPECT_THAT(After(1), ElementsAre(0));
}

TEST_F(GrowingCaptureTest, APausedWriterIsWaitedFor) {
  unreadable_ = {"a"};
  Append("a", 100);
  EXPECT_THAT(After(0), IsEmpty());
  EXPECT_THAT(After(5000), IsEmpty());
  Grow(0, 200);
  unreadable_.clear();
  EXPECT_THAT(After(500), IsEmpty());
  EXPECT_THAT(After(1000), ElementsAre(0));
}

TEST_F(GrowingCaptureTest, ALateNameThatWouldRenumberFramesIsRefused) {
  Append("frame_10", 100);
  EXPECT_THAT(After(0), IsEmpty());
  EXPECT_THAT(After(1000), ElementsAre(0));
  files_.insert(files_.begin(), FrameFile{{0, "frame_9"}, 100, {}});
  files_[1].frame.number = 1;
  const auto late = capture_.Next(files_, now_);
  EXPECT_EQ(late.status().code(), absl::StatusCode::kAlreadyExists);
  EXPECT_THAT(std::string(late.status().message()), testing::AllOf(HasSubstr("frame_9"), HasSubstr("frame_10"), HasSubstr("--name")));
}

TEST_F(GrowingCaptureTest, AFileThatChangesAfterItLeftIsToldOnce) {
  Append("a", 100);
  Append("b", 100);
  EXPECT_THAT(After(0), IsEmpty());
  EXPECT_THAT(After(1000), ElementsAre(0, 1));
  EXPECT_THAT(capture_.ChangedLater(files_), IsEmpty());
  Grow(1, 300);
  EXPECT_THAT(capture_.ChangedLater(files_), ElementsAre("b"));
  EXPECT_THAT(capture_.ChangedLater(files_), IsEmpty());
}

}  // namespace
}  // namespace vorocast::capture
