// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <string>
#include <vector>

#include "proto/jobs.pb.h"
#include "services/report/attempt_totals.h"
#include "services/report/timeline.h"

/// The morning report of a session: one HTML page with nothing outside of it.
namespace vorocast::report {

struct FramePicture {
  std::string task;  // "frame 412: tessellate"
  std::string png;   // bytes; empty: there is no picture, and `why_not` says why
  std::string why_not;
};

struct JobReport {
  v1::Job job;
  AttemptTotals attempts;
  std::string attempts_missing;  // why they could not be had; empty if they could
  std::vector<FramePicture> pictures;
};

struct SessionReport {
  std::string session;
  std::string scheduler;  // its address
  std::string version;    // of this program
  double made = 0;        // seconds since 1970
  v1::Fleet fleet;
  std::vector<JobReport> jobs;  // newest first
  Timeline timeline;
};

/// What of a job failed, and which frames; at most so many of these get a picture.
inline constexpr std::size_t kPicturesMax = 12;

std::string ToHtml(const SessionReport& report);

}  // namespace vorocast::report
