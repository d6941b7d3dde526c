// SPDX-License-Identifier: AGPL-3.0-or-later
#include "scheduler/server/demand.h"

namespace vorocast::server {
namespace {

std::int32_t CountOf(const core::KindCounts& counts, core::Phase phase) { return counts.phase[static_cast<std::size_t>(phase)]; }

}  // namespace

fleet::Demand DemandOf(const core::State& state) {
  fleet::Demand demand;
  for (const tasks::Kind kind : tasks::kAllKinds) {
    // Simulations go to a service of their own.
    if (kind == tasks::Kind::kSimulate) continue;
    fleet::KindDemand of_kind;
    double seconds = 0;
    std::int32_t measured = 0;
    for (const core::Job& job : state.jobs) {
      const core::KindCounts& counts = job.counts[static_cast<std::size_t>(kind)];
      seconds += counts.seconds;
      measured += counts.measured;
      of_kind.running += CountOf(counts, core::Phase::kRunning);
      if (job.starts_nothing()) continue;
      of_kind.ready += CountOf(counts, core::Phase::kReady);
      of_kind.blocked += CountOf(counts, core::Phase::kBlocked);
    }
    if (measured > 0) of_kind.seconds_mean = seconds / measured;
    demand.kinds.push_back(of_kind);
  }
  for (const core::Worker& worker : state.workers) {
    if (worker.connection == 0) continue;
    (worker.runs.empty() ? demand.idle_workers : demand.busy_workers).push_back(worker.name);
  }
  return demand;
}

}  // namespace vorocast::server
