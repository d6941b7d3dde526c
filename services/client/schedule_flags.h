// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <cstdint>
#include <string>

#include <CLI/CLI.hpp>

#include "absl/time/time.h"
#include "proto/jobs.pb.h"
#include "services/base/status.h"

namespace vorocast::client {

/// "12G", "512M", "1.5T" or plain bytes; G is 2^30. INVALID_ARGUMENT otherwise.
absl::StatusOr<std::int64_t> ParseMemory(const std::string& text);

/// "06:30" is the next half past six after `now` in `zone`; "2026-11-24 06:30" or "2026-11-24T06:30", with seconds or without, is that instant in
/// `zone`, or in the zone that follows it ("Z", "+01:00"); "2026-11-24" is the end of that day. Seconds since 1970. INVALID_ARGUMENT otherwise, and
/// for what has passed.
absl::StatusOr<double> ParseDeadline(const std::string& text, absl::Time now, absl::TimeZone zone);

/// --memory, --time-factor: how far a task may go.
struct LimitFlags {
  std::string memory;
  double time_factor = 0;

  void AddTo(CLI::App& command);
  absl::StatusOr<std::int64_t> MemoryLimit() const;  // bytes; 0: not asked for
};

/// --workers-max, --deadline and the limits: when a job runs and on how much.
struct ScheduleFlags {
  std::int32_t workers_max = 0;
  std::string deadline;
  LimitFlags limits;

  void AddTo(CLI::App& command);
  absl::Status Fill(v1::SubmitJobRequest& request) const;
};

/// ", will be late by 12:00", ", its deadline passed 1:00 ago", or nothing. `now` in seconds since 1970.
std::string DescribeLateness(const v1::Job& job, double now);

}  // namespace vorocast::client
