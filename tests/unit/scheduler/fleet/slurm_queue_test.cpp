// SPDX-License-Identifier: AGPL-3.0-or-later
#include "scheduler/fleet/slurm_queue.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace vorocast::fleet {
namespace {

using testing::ElementsAre;
using testing::IsEmpty;
using State = SlurmMember::State;

TEST(SlurmQueue, ReadsWhatSlurm22Prints) {
  const auto members = ParseQueue(R"({"meta": {}, "errors": [], "jobs": [
    {"name": "farm", "job_state": "PENDING", "array_job_id": 7, "array_task_id": null, "array_task_string": "4-6%2"},
    {"name": "farm", "job_state": "RUNNING", "array_job_id": 7, "array_task_id": 3, "array_task_string": ""},
    {"name": "farm", "job_state": "COMPLETING", "array_job_id": 7, "array_task_id": 2, "array_task_string": ""},
    {"name": "farm", "job_state": "FAILED", "array_job_id": 7, "array_task_id": 1, "array_task_string": ""},
    {"name": "another", "job_state": "RUNNING", "array_job_id": 8, "array_task_id": 1, "array_task_string": ""}]})",
                                  "farm");
  ASSERT_TRUE(members.ok()) << members.status();
  EXPECT_THAT(*members, ElementsAre(SlurmMember{7, 2, State::kEnding}, SlurmMember{7, 3, State::kUp}, SlurmMember{7, 4, State::kQueued},
                                    SlurmMember{7, 5, State::kQueued}, SlurmMember{7, 6, State::kQueued}));
  EXPECT_EQ(Name(members->front()), "7_2");
}

TEST(SlurmQueue, ReadsWhatLaterVersionsPrint) {
  const auto members =
      ParseQueue(R"({"jobs": [{"name": "farm", "job_state": ["RUNNING"], "array_job_id": {"set": true, "infinite": false, "number": 7},
    "array_task_id": {"set": true, "infinite": false, "number": 0}, "array_task_string": ""}]})",
                 "farm");
  ASSERT_TRUE(members.ok());
  EXPECT_THAT(*members, ElementsAre(SlurmMember{7, 0, State::kUp}));
}

TEST(SlurmQueue, PassesOverWhatItCannotRead) {
  const auto members = ParseQueue(R"({"jobs": [null, 3, {}, {"name": "farm"}, {"name": 5, "job_state": "RUNNING"},
    {"name": "farm", "job_state": "RUNNING", "array_job_id": "seven", "array_task_id": 1},
    {"name": "farm", "job_state": "RUNNING", "array_job_id": -1, "array_task_id": 1},
    {"name": "farm", "job_state": 17, "array_job_id": 7, "array_task_id": 1},
    {"name": "farm", "job_state": "RUNNING", "array_job_id": {"set": 1}, "array_task_id": 1},
    {"name": "farm", "job_state": "RUNNING", "array_job_id": 7, "array_task_id": {"number": 2}},
    {"name": "farm", "job_state": "RUNNING", "array_job_id": 7, "array_task_id": 9}]})",
                                  "farm");
  ASSERT_TRUE(members.ok());
  EXPECT_THAT(*members, ElementsAre(SlurmMember{7, 9, State::kUp}));
}

TEST(SlurmQueue, SaysWhenItIsNoQueueAtAll) {
  for (const char* text : {"", "slurm_load_jobs error", "[]", "{}", R"({"jobs": 5})", R"({"jobs": [)", "\xff\xfe"}) {
    EXPECT_EQ(ParseQueue(text, "farm").status().code(), absl::StatusCode::kDataLoss) << text;
  }
}

TEST(SlurmQueue, RangesOfTasks) {
  EXPECT_THAT(ParseTaskRanges("1-4,7,9-13:2%8", 100), ElementsAre(1, 2, 3, 4, 7, 9, 11, 13));
  EXPECT_THAT(ParseTaskRanges("0-999999999", 3), ElementsAre(0, 1, 2));
  EXPECT_THAT(ParseTaskRanges("3-1,x,-,5-,1-2:0,99999999999999999999,8,...", 100), ElementsAre(8));
  EXPECT_THAT(ParseTaskRanges("", 100), IsEmpty());
}

TEST(SlurmQueue, NumbersOfSubmittedJobs) {
  EXPECT_EQ(*ParseSubmitted("12\n"), 12);
  EXPECT_EQ(*ParseSubmitted("12;cluster\n"), 12);
  for (const char* text : {"", "Submitted batch job 12", "-3", "0"}) EXPECT_FALSE(ParseSubmitted(text).ok()) << text;
}

}  // namespace
}  // namespace vorocast::fleet
