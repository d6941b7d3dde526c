// SPDX-License-Identifier: AGPL-3.0-or-later
#include "scheduler/server/fleet_message.h"

#include <cmath>

#include <fmt/format.h>

#include "scheduler/core/job_view.h"
#include "scheduler/server/engine.h"

namespace vorocast::server {
namespace {

constexpr int kSetAsideMax = 100;

std::string Duration(double seconds) {
  const auto whole = static_cast<long long>(std::llround(seconds));
  return fmt::format("{}:{:02}:{:02}", whole / 3600, whole / 60 % 60, whole % 60);
}

}  // namespace

void FillFleet(const core::State& state, v1::Fleet& fleet) {
  std::int32_t workers = 0;
  std::int32_t slots = 0;
  std::int32_t busy = 0;
  for (const core::Worker& worker : state.workers) {
    if (worker.connection == 0) continue;
    ++workers;
    slots += worker.slots;
    busy += static_cast<std::int32_t>(worker.runs.size());
  }
  fleet.set_workers(workers);
  fleet.set_slots(slots);
  fleet.set_busy(busy);
  const double wall = WallSeconds();
  for (const auto& [until, index] : state.set_aside) {
    if (fleet.set_aside_size() == kSetAsideMax) break;
    v1::SetAside& aside = *fleet.add_set_aside();
    aside.set_worker(state.workers[index].name);
    aside.set_reason(state.workers[index].health.reason);
    // The core's clock is not people's.
    aside.set_until(wall + absl::ToDoubleSeconds(until - MonotonicNow()));
  }
}

std::string ExplainLateness(const core::State& state, const core::Job& job, double wall) {
  if (job.terms.deadline <= 0 || core::PhaseOf(job) != core::Phase::kRunning) return {};
  if (wall > job.terms.deadline) return fmt::format(" Its deadline passed {} ago.", Duration(wall - job.terms.deadline));
  const double left = core::View(state, job).seconds_left;
  if (left < 0) return {};
  const double late = wall + left - job.terms.deadline;
  return late > 0 ? fmt::format(" It will be late by {}.", Duration(late)) : fmt::format(" It should end {} before its deadline.", Duration(-late));
}

}  // namespace vorocast::server
