// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "proto/jobs.pb.h"

namespace vorocast::report {

/// Which worker did what, when: a row a worker, coloured by kind of task. Its drawing is bounded however many attempts there were.
class Timeline {
 public:
  /// Attempts whose beginning is not on record are passed over; one that runs lasts until `now`, seconds since 1970.
  void Add(const v1::TaskAttempt& attempt, double now);

  bool empty() const { return attempts_.empty(); }
  /// Seconds since 1970: of the first beginning and the last end.
  double begin() const { return begin_; }
  double end() const { return end_; }

  /// An <svg> element. Time is cut into columns; each shows the kind that took most of it on that worker, and a red mark where an attempt
  /// failed. The busiest workers are shown if there are very many.
  std::string Svg() const;

 private:
  struct Attempt {
    std::uint32_t worker = 0;
    std::uint8_t kind = 0;
    bool failed = false;
    double begin = 0;
    double end = 0;
  };
  std::map<std::string, std::uint32_t> workers_;
  std::vector<Attempt> attempts_;
  double begin_ = 0;
  double end_ = 0;
};

/// "#4477aa", one for each kind of task; grey for another name.
std::string_view KindColour(std::string_view kind);

}  // namespace vorocast::report
