// SPDX-License-Identifier: AGPL-3.0-or-later
#include "services/client/schedule_flags.h"

#include <cmath>
#include <cstdio>

#include <fmt/format.h>

#include "absl/strings/numbers.h"
#include "absl/time/civil_time.h"
#include "absl/time/clock.h"
#include "services/client/job_view.h"

namespace vorocast::client {
namespace {

/// "HH:MM" and nothing else.
bool ParseClock(const std::string& text, int& hour, int& minute) {
  int used = 0;
  if (std::sscanf(text.c_str(), "%2d:%2d%n", &hour, &minute, &used) != 2 || static_cast<std::size_t>(used) != text.size()) return false;
  return hour >= 0 && hour < 24 && minute >= 0 && minute < 60;
}

absl::Time NextClock(int hour, int minute, absl::Time now, absl::TimeZone zone) {
  absl::CivilDay day(absl::ToCivilSecond(now, zone));
  while (true) {
    const absl::Time time = absl::FromCivil(absl::CivilMinute(day.year(), day.month(), day.day(), hour, minute), zone);
    if (time > now) return time;
    ++day;
  }
}

}  // namespace

absl::StatusOr<std::int64_t> ParseMemory(const std::string& text) {
  std::string number = text;
  int shift = 0;
  const std::size_t unit = number.empty() ? std::string::npos : std::string("KMGT").find(number.back());
  if (unit != std::string::npos) {
    shift = 10 * static_cast<int>(unit + 1);
    number.pop_back();
  }
  double value = 0;
  if (!absl::SimpleAtod(number, &value) || !(value > 0) || value * std::ldexp(1.0, shift) > 9e18) {
    return absl::InvalidArgumentError(fmt::format("--memory {}: write a size, for example 12G or 512M", text));
  }
  return static_cast<std::int64_t>(value * std::ldexp(1.0, shift));
}

absl::StatusOr<double> ParseDeadline(const std::string& text, absl::Time now, absl::TimeZone zone) {
  absl::Time deadline;
  int hour = 0;
  int minute = 0;
  bool read = ParseClock(text, hour, minute);
  if (read) deadline = NextClock(hour, minute, now, zone);
  std::string ignored;
  for (const char* format : {"%Y-%m-%dT%H:%M:%S%Ez", "%Y-%m-%d %H:%M:%S%Ez", "%Y-%m-%dT%H:%M%Ez", "%Y-%m-%d %H:%M%Ez", "%Y-%m-%dT%H:%M:%S",
                             "%Y-%m-%d %H:%M:%S", "%Y-%m-%dT%H:%M", "%Y-%m-%d %H:%M"}) {
    if (!read) read = absl::ParseTime(format, text, zone, &deadline, &ignored);
  }
  if (absl::Time day; !read && absl::ParseTime("%Y-%m-%d", text, zone, &day, &ignored)) {
    read = true;
    deadline = absl::FromCivil(absl::CivilDay(absl::ToCivilSecond(day, zone)) + 1, zone);
  }
  if (!read) return absl::InvalidArgumentError(fmt::format("--deadline {}: write 06:30, or 2026-11-24 06:30", text));
  if (deadline <= now) return absl::InvalidArgumentError(fmt::format("--deadline {}: that has passed", text));
  return absl::ToDoubleSeconds(deadline - absl::UnixEpoch());
}

void LimitFlags::AddTo(CLI::App& command) {
  command.add_option("--memory", memory, "Memory that a task may take, for example 12G (the service's limit; doubled once if a task reaches it)");
  command.add_option("--time-factor", time_factor, "The usual time limits of tasks times this (1; doubled once if a task reaches its limit)")
      ->check(CLI::Range(0.1, 100.0));
}

absl::StatusOr<std::int64_t> LimitFlags::MemoryLimit() const {
  if (memory.empty()) return 0;
  return ParseMemory(memory);
}

void ScheduleFlags::AddTo(CLI::App& command) {
  command.add_option("--workers-max", workers_max, "Tasks of this job that run at once (as many as there are workers)")
      ->check(CLI::Range(1, 1000000));
  command.add_option("--deadline", deadline, "When it should have ended: 06:30 (the next one, local time) or 2026-11-24 06:30");
  limits.AddTo(command);
}

absl::Status ScheduleFlags::Fill(v1::SubmitJobRequest& request) const {
  request.set_workers_max(workers_max);
  request.set_time_factor(limits.time_factor);
  ASSIGN_OR_RETURN(const std::int64_t memory, limits.MemoryLimit());
  request.set_memory_limit(memory);
  if (deadline.empty()) return absl::OkStatus();
  ASSIGN_OR_RETURN(const double when, ParseDeadline(deadline, absl::Now(), absl::LocalTimeZone()));
  request.set_deadline(when);
  return absl::OkStatus();
}

std::string DescribeLateness(const v1::Job& job, double now) {
  if (job.deadline() <= 0) return {};
  if (job.ended() > 0) {
    return job.ended() > job.deadline() ? fmt::format(", {} after its deadline", FormatDuration(job.ended() - job.deadline())) : "";
  }
  if (now > job.deadline()) return fmt::format(", its deadline passed {} ago", FormatDuration(now - job.deadline()));
  const double late = now + job.seconds_left() - job.deadline();
  return job.seconds_left() >= 0 && late > 0 ? fmt::format(", will be late by {}", FormatDuration(late)) : "";
}

}  // namespace vorocast::client
