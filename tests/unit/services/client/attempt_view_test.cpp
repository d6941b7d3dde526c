// SPDX-License-Identifier: AGPL-3.0-or-later
#include "services/client/attempt_view.h"

#include <gtest/gtest.h>

#include "services/client/fleet_view.h"

namespace vorocast::client {
namespace {

TEST(AttemptView, ShowsFactsCauseAndWhatWasPrinted) {
  v1::TaskAttempt attempt;
  attempt.set_task("frame 12: tessellate");
  attempt.set_kind("tessellate");
  attempt.set_number(31);
  attempt.set_worker("farm-3");
  attempt.set_started(0.25);
  attempt.set_ended(2.75);
  attempt.set_outcome(v1::FAILED);
  attempt.set_cause("crashed: killed by SIGSEGV");
  attempt.set_cpu_seconds(1.5);
  attempt.set_memory_peak(std::int64_t{512} << 20);
  attempt.set_log("one\ntwo");
  EXPECT_EQ(DescribeAttempt(attempt, absl::UTCTimeZone()),
            "frame 12: tessellate  1970-01-01 00:00:00  attempt 31  failed after 2.50 s, 1.50 CPU s, 512 MiB  worker farm-3\n"
            "    cause: crashed: killed by SIGSEGV\n    | one\n    | two\n");
}

TEST(AttemptView, WhatAnAttemptPrintedCannotMoveTheCursor) {
  EXPECT_EQ(Indented("a\x1b[2Jb\tc\r\n\nlast", "> "), "> a·[2Jb\tc·\n> \n> last\n");
  EXPECT_EQ(Indented("", "> "), "");
}

TEST(AttemptView, FormatsBytes) {
  EXPECT_EQ(FormatBytes(999), "999 B");
  EXPECT_EQ(FormatBytes(1536), "1.5 KiB");
  EXPECT_EQ(FormatBytes(std::int64_t{2500} << 30), "2.4 TiB");
}

TEST(FleetView, SaysWhoWorks) {
  v1::Fleet fleet;
  EXPECT_EQ(DescribeFleet(fleet, absl::UTCTimeZone()), "No worker is connected\n");
  fleet.set_description("Slurm: 3 workers up, 2 queued, at most 9");
  fleet.set_workers(3);
  fleet.set_slots(12);
  fleet.set_busy(7);
  v1::SetAside& aside = *fleet.add_set_aside();
  aside.set_worker("farm-\x1b[2J");
  aside.set_reason("5 tasks crashed");
  aside.set_until(3661);
  EXPECT_EQ(DescribeFleet(fleet, absl::UTCTimeZone()),
            "3 workers connected, 7 of 12 slots busy (Slurm: 3 workers up, 2 queued, at most 9)\n"
            "  set aside until 01:01:01: farm-·[2J: 5 tasks crashed\n");
}

}  // namespace
}  // namespace vorocast::client
