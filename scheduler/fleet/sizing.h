// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <cstdint>
#include <string>
#include <vector>

/// How many workers the work that is left deserves. Values in, values out.
namespace vorocast::fleet {

/// Tasks of one kind and one job that have not ended.
struct KindDemand {
  std::int32_t ready = 0;
  std::int32_t running = 0;
  std::int32_t blocked = 0;  // their inputs are still to be made
  double seconds_mean = 0;   // of an attempt, as measured; 0: none has ended yet
};

/// What the scheduler knows at one moment.
struct Demand {
  std::vector<KindDemand> kinds;
  std::vector<std::string> idle_workers;  // names of connected ones that hold nothing
  std::vector<std::string> busy_workers;
};

struct SizingLimits {
  std::int32_t workers_min = 0;
  std::int32_t workers_max = 16;
  std::int32_t queued_max = 8;     // waiting in the cluster's queue at once
  std::int32_t slots = 1;          // tasks at once of a worker
  double seconds_guess = 10;       // of a task whose kind has not been measured
  double seconds_left_floor = 60;  // a shorter time than this is not worth more workers: they need some time to come up
  double surplus_seconds = 30;     // workers with nothing to do are kept for so long
};

struct SizingInput {
  Demand demand;
  std::int32_t workers_up = 0;
  std::int32_t workers_queued = 0;
  double seconds_left = 0;          // until the work should be done
  double seconds_with_surplus = 0;  // since there have been more workers than could be used
};

struct SizingDecision {
  std::int32_t ask = 0;       // for so many more
  std::int32_t withdraw = 0;  // of the queued ones
  std::int32_t drain = 0;     // of those that are up
  bool surplus = false;       // more workers than could be used, now
};

/// Enough workers to work off the backlog in the time left, never more than there are tasks, within the limits. One that is up is kept as long
/// as there is a task for it, however few are needed, since it costs nothing to keep and something to start.
SizingDecision Size(const SizingInput& input, const SizingLimits& limits);

/// Seconds of one slot's work.
double WorkSeconds(const Demand& demand, double seconds_guess);

}  // namespace vorocast::fleet
