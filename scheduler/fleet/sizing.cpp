// SPDX-License-Identifier: AGPL-3.0-or-later
#include "scheduler/fleet/sizing.h"

#include <algorithm>
#include <cmath>

namespace vorocast::fleet {
namespace {

std::int64_t TasksLeft(const Demand& demand) {
  std::int64_t tasks = 0;
  for (const KindDemand& kind : demand.kinds) tasks += std::int64_t{kind.ready} + kind.running + kind.blocked;
  return tasks;
}

}  // namespace

double WorkSeconds(const Demand& demand, double seconds_guess) {
  double seconds = 0;
  for (const KindDemand& kind : demand.kinds) {
    const double each = kind.seconds_mean > 0 ? kind.seconds_mean : seconds_guess;
    // What runs is half done on average.
    seconds += each * (kind.ready + kind.blocked + 0.5 * kind.running);
  }
  return seconds;
}

SizingDecision Size(const SizingInput& input, const SizingLimits& limits) {
  const auto clamp = [&](double workers) {
    return static_cast<std::int32_t>(std::clamp(std::ceil(workers), double(limits.workers_min), double(limits.workers_max)));
  };
  const std::int32_t useful = clamp(double(TasksLeft(input.demand)) / limits.slots);
  const double seconds_left = std::max(input.seconds_left, limits.seconds_left_floor);
  const std::int32_t needed = std::min(useful, clamp(WorkSeconds(input.demand, limits.seconds_guess) / (seconds_left * limits.slots)));
  const std::int32_t up = std::max(input.workers_up, 0);
  const std::int32_t queued = std::max(input.workers_queued, 0);

  SizingDecision decision;
  decision.surplus = up + queued > useful;
  if (up + queued < needed) {
    decision.ask = std::clamp(needed - up - queued, 0, std::max(0, limits.queued_max - queued));
    return decision;
  }
  // One that waits in the queue takes a place from others and has nothing to lose.
  decision.withdraw = std::clamp(up + queued - useful, 0, queued);
  if (input.seconds_with_surplus >= limits.surplus_seconds) decision.drain = std::max(0, up - useful);
  return decision;
}

}  // namespace vorocast::fleet
