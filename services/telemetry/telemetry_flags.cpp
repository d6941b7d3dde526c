// SPDX-License-Identifier: AGPL-3.0-or-later
#include "services/telemetry/telemetry_flags.h"

#include <spdlog/spdlog.h>

#include "services/telemetry/log.h"

namespace vorocast::telemetry {

void TelemetryFlags::AddTo(CLI::App& program) {
  program.add_option("--log-format", log_format_, "text, or json: one object a line")->check(CLI::IsMember({"text", "json"}))->capture_default_str();
  program.add_option("--log-level", log_level_, "Nothing less than this is logged")
      ->check(CLI::IsMember({"debug", "info", "warn", "error"}))
      ->capture_default_str();
  program.add_option("--metrics", metrics_,
                     "HOST:PORT on which Prometheus may scrape http://HOST:PORT/metrics; a port alone means this machine only. Off if not given");
}

absl::Status TelemetryFlags::StartLog(const std::string& process, const std::filesystem::path& file) const {
  return telemetry::StartLog({.process = process, .format = log_format_, .level = log_level_, .file = file});
}

absl::StatusOr<std::unique_ptr<MetricsServer>> TelemetryFlags::StartMetrics(std::shared_ptr<prometheus::Registry> registry) const {
  if (metrics_.empty()) return nullptr;
  ASSIGN_OR_RETURN(auto server, MetricsServer::Start(metrics_, std::move(registry)));
  spdlog::info("metrics: address={}", server->address());
  return server;
}

}  // namespace vorocast::telemetry
