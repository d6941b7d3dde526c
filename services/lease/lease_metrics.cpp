// SPDX-License-Identifier: AGPL-3.0-or-later
#include "services/lease/lease_metrics.h"

#include <algorithm>

#include "services/telemetry/metrics_server.h"

namespace vorocast::lease {
namespace {

prometheus::Gauge& AddGauge(prometheus::Registry& registry, const std::string& name, const std::string& help) {
  return prometheus::BuildGauge().Name(name).Help(help).Register(registry).Add({});
}

std::string CauseLabel(const v1::Finished& finished) {
  if (finished.has_succeeded()) return "none";
  std::string name = v1::Failed::Cause_Name(finished.failed().cause());
  std::transform(name.begin(), name.end(), name.begin(), [](char c) { return c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c; });
  return name;
}

}  // namespace

LeaseMetrics::LeaseMetrics(const std::string& process, std::int32_t slots)
    : slots_(AddGauge(*registry_, "vorocast_worker_slots", "Tasks that this process runs at once")),
      busy_(AddGauge(*registry_, "vorocast_worker_busy", "Tasks that run now")),
      connected_(AddGauge(*registry_, "vorocast_worker_connected", "1 while a scheduler has welcomed this process")),
      attempts_(prometheus::BuildCounter()
                    .Name("vorocast_worker_attempts_total")
                    .Help("Attempts that ended here, by outcome and by the cause of a failure")
                    .Register(*registry_)),
      seconds_(prometheus::BuildCounter()
                   .Name("vorocast_worker_attempt_seconds_total")
                   .Help("Wall clock of the attempts that ended here")
                   .Register(*registry_)
                   .Add({})) {
  telemetry::AddBuildInformation(*registry_, process);
  slots_.Set(slots);
}

void LeaseMetrics::AttemptEnded(const v1::Finished& finished) {
  attempts_.Add({{"outcome", finished.has_succeeded() ? "done" : "failed"}, {"cause", CauseLabel(finished)}}).Increment();
  seconds_.Increment(std::max(0.0, finished.has_succeeded() ? finished.succeeded().seconds() : finished.failed().seconds()));
}

}  // namespace vorocast::lease
