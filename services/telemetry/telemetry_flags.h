// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <filesystem>
#include <memory>
#include <string>

#include <CLI/CLI.hpp>

#include "services/base/status.h"
#include "services/telemetry/metrics_server.h"

namespace vorocast::telemetry {

/// --log-format, --log-level and --metrics: what every service lets its operator choose.
class TelemetryFlags {
 public:
  void AddTo(CLI::App& program);

  /// Begins the log of `process`, also into `file` if that is not empty.
  absl::Status StartLog(const std::string& process, const std::filesystem::path& file = {}) const;
  /// Answers scrapes of `registry` until it is destroyed; null unless asked for.
  absl::StatusOr<std::unique_ptr<MetricsServer>> StartMetrics(std::shared_ptr<prometheus::Registry> registry) const;

 private:
  std::string log_format_ = "text";
  std::string log_level_ = "info";
  std::string metrics_;
};

}  // namespace vorocast::telemetry
