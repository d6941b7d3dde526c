// SPDX-License-Identifier: AGPL-3.0-or-later
#include "services/client/job_view.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace vorocast::client {
namespace {

using testing::HasSubstr;
using testing::Not;

TEST(FormatDuration, ReadsLikeAClock) {
  EXPECT_EQ(FormatDuration(7), "0:07");
  EXPECT_EQ(FormatDuration(125), "2:05");
  EXPECT_EQ(FormatDuration(3 * 3600 + 62), "3:01:02");
  EXPECT_EQ(FormatDuration(-1), "–");
}

v1::Job JobWithAFailure() {
  v1::Job job;
  job.set_id("job-1");
  job.set_sequence_name("take1");
  job.set_state(v1::RUNNING);
  job.set_seconds_left(40);
  v1::Stage& stage = *job.add_stages();
  stage.set_kind("tessellate");
  stage.set_total(20);
  stage.set_done(12);
  stage.set_failed(1);
  stage.set_fraction(0.6);
  v1::FailedTask& failure = *job.add_failures();
  failure.set_label("frame 3: tessellate");
  failure.set_cause("the file ends after 100 of 65386 points");
  return job;
}

TEST(DescribeJob, TellsStagesFailuresAndTimeLeft) {
  const std::string text = DescribeJob(JobWithAFailure());
  EXPECT_THAT(text, HasSubstr("take1 (job-1): running, about 0:40 left"));
  EXPECT_THAT(text, HasSubstr("12/20"));
  EXPECT_THAT(text, HasSubstr("1 failed"));
  EXPECT_THAT(text, HasSubstr("frame 3: tessellate: the file ends after 100 of 65386 points"));
}

TEST(DescribeJob, AnEndedJobHasNoTimeLeft) {
  v1::Job job = JobWithAFailure();
  job.set_state(v1::DONE);
  EXPECT_TRUE(HasEnded(job));
  EXPECT_THAT(DescribeJob(job), Not(HasSubstr("left")));
}

TEST(DescribeJobLine, AnEndedJobSaysHow) {
  v1::Job job = JobWithAFailure();
  job.set_state(v1::FAILED);
  EXPECT_EQ(DescribeJobLine(job), "failed: tessellate 12/20");
}

TEST(DescribeJobLine, LeavesOutWhatWasThereAlready) {
  v1::Job job = JobWithAFailure();
  v1::Stage& reused = *job.add_stages();
  reused.set_kind("track");
  reused.set_total(4);
  reused.set_done(4);
  reused.set_reused(4);
  EXPECT_EQ(DescribeJobLine(job), "tessellate 12/20 · about 0:40 left");
}

}  // namespace
}  // namespace vorocast::client
