// SPDX-License-Identifier: AGPL-3.0-or-later
#include "scheduler/server/demand.h"

#include <algorithm>

namespace vorocast::server {
namespace {

std::int32_t CountOf(const core::KindCounts& counts, core::Phase phase) { return counts.phase[static_cast<std::size_t>(phase)]; }

}  // namespace

fleet::Demand DemandOf(const core::State& state) {
  fleet::Demand demand;
  for (const tasks::Kind kind : tasks::kAllKinds) {
    // Simulations go to a service of their own.
    if (kind == tasks::Kind::kSimulate) continue;
    const auto index = static_cast<std::size_t>(kind);
    double seconds = 0;
    std::int32_t measured = 0;
    for (const core::Job& job : state.jobs) {
      seconds += job.counts[index].seconds;
      measured += job.counts[index].measured;
    }
    for (const core::Job& job : state.jobs) {
      const core::KindCounts& counts = job.counts[index];
      fleet::KindDemand of_job{.running = CountOf(counts, core::Phase::kRunning)};
      if (!job.starts_nothing() && !job.paused) {
        of_job.ready = CountOf(counts, core::Phase::kReady);
        of_job.blocked = CountOf(counts, core::Phase::kBlocked);
      }
      // More workers than it may have would only stand by.
      if (job.terms.workers_max > 0) of_job.ready = std::min(of_job.ready, std::max(0, job.terms.workers_max - job.at_work));
      if (of_job.ready + of_job.running + of_job.blocked == 0) continue;
      // Takes differ in size: what other jobs needed is only a guess.
      if (measured > 0) of_job.seconds_mean = seconds / measured;
      if (counts.measured > 0) of_job.seconds_mean = counts.seconds / counts.measured;
      demand.kinds.push_back(of_job);
    }
  }
  for (const core::Worker& worker : state.workers) {
    if (worker.connection == 0) continue;
    (worker.runs.empty() ? demand.idle_workers : demand.busy_workers).push_back(worker.name);
  }
  return demand;
}

}  // namespace vorocast::server
