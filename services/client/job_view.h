// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <chrono>
#include <string>

#include "proto/jobs.pb.h"

namespace vorocast::client {

/// "1:23:45", "2:05", or "0:07"; "–" when negative (not known yet).
std::string FormatDuration(double seconds);

/// The job's take, and the second one if it has two: "dance onto walk".
std::string TakesOf(const v1::Job& job);

/// A table of the job's stages with a bar each, failures below, and the time left: what `status` and `watch` print.
std::string DescribeJob(const v1::Job& job);

/// One line on all stages, for logs: "tessellate 12/21 · track 0/2 · about 0:40 left".
std::string DescribeJobLine(const v1::Job& job);

bool HasEnded(const v1::Job& job);

/// Shows a job as it goes on: redrawn in place on a terminal, a line every few seconds elsewhere.
class JobView {
 public:
  JobView();
  void Show(const v1::Job& job);
  /// Shows the last state, in full on a terminal.
  void Finish(const v1::Job& job);
  /// A line of its own between the updates.
  void Say(const std::string& line);

 private:
  void Erase();

  bool terminal_;
  int lines_drawn_ = 0;
  std::chrono::steady_clock::time_point last_line_{};
  std::string last_text_;
};

}  // namespace vorocast::client
