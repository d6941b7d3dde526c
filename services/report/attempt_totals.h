// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "proto/jobs.pb.h"

namespace vorocast::report {

/// What a job's attempts come to; its size does not grow with their number.
class AttemptTotals {
 public:
  struct Kind {
    std::int64_t attempts = 0;
    std::int64_t failed = 0;
    double seconds = 0;
    double cpu_seconds = 0;
    std::int64_t memory_peak = 0;  // the largest
  };
  struct Failure {
    std::string task;
    std::string worker;
    std::string cause;
    double seconds = 0;
    std::string log_end;  // its last lines
  };
  struct Slow {
    std::string task;
    std::string worker;
    double seconds = 0;
  };

  void Add(const v1::TaskAttempt& attempt);

  std::int64_t attempts() const { return attempts_; }
  std::int64_t failed() const { return failed_; }
  const std::map<std::string, Kind>& kinds() const { return kinds_; }
  /// The first ones.
  const std::vector<Failure>& failures() const { return failures_; }
  /// Successful attempts, longest first.
  std::vector<Slow> Slowest() const;

 private:
  std::int64_t attempts_ = 0;
  std::int64_t failed_ = 0;
  std::map<std::string, Kind> kinds_;
  std::vector<Failure> failures_;
  std::vector<Slow> slow_;  // a heap, the shortest on top
};

}  // namespace vorocast::report
