// SPDX-License-Identifier: AGPL-3.0-or-later
#include "services/client/schedule_flags.h"

#include <gtest/gtest.h>

namespace vorocast::client {
namespace {

TEST(ScheduleFlags, ReadsSizes) {
  EXPECT_EQ(*ParseMemory("12G"), std::int64_t{12} << 30);
  EXPECT_EQ(*ParseMemory("1.5K"), 1536);
  EXPECT_EQ(*ParseMemory("4096"), 4096);
  for (const char* wrong : {"", "G", "-1G", "12GB", "nan", "inf", "1e30T"}) EXPECT_FALSE(ParseMemory(wrong).ok()) << wrong;
}

TEST(ScheduleFlags, ReadsDeadlines) {
  // 1973-11-29 21:33:09 UTC, by the definition of that clock.
  const absl::Time now = absl::FromUnixSeconds(123'456'789);
  const absl::TimeZone utc = absl::UTCTimeZone();
  EXPECT_EQ(*ParseDeadline("21:34", now, utc), 123'456'789 + 51);
  EXPECT_EQ(*ParseDeadline("21:33", now, utc), 123'456'789 - 9 + 86'400) << "that of tomorrow";
  EXPECT_EQ(*ParseDeadline("1973-11-30 00:00", now, utc), 123'379'200 + 86'400);
  EXPECT_EQ(*ParseDeadline("1973-11-30T00:00:00Z", now, absl::FixedTimeZone(3600)), 123'379'200 + 86'400);
  EXPECT_EQ(*ParseDeadline("1973-11-30T00:00", now, absl::FixedTimeZone(3600)), 123'379'200 + 86'400 - 3600);
  EXPECT_EQ(*ParseDeadline("1973-11-29", now, utc), 123'379'200 + 86'400) << "the end of that day";
  for (const char* wrong : {"", "24:00", "6", "06:30x", "1973-11-28", "tomorrow"}) EXPECT_FALSE(ParseDeadline(wrong, now, utc).ok()) << wrong;
}

TEST(ScheduleFlags, SaysWhatWillBeLate) {
  v1::Job job;
  job.set_seconds_left(100);
  EXPECT_EQ(DescribeLateness(job, 1000), "");
  job.set_deadline(1040);
  EXPECT_EQ(DescribeLateness(job, 1000), ", will be late by 1:00");
  EXPECT_EQ(DescribeLateness(job, 1050), ", its deadline passed 0:10 ago");
  job.set_deadline(1200);
  EXPECT_EQ(DescribeLateness(job, 1000), "");
  job.set_seconds_left(-1);
  EXPECT_EQ(DescribeLateness(job, 1000), "");
}

}  // namespace
}  // namespace vorocast::client
