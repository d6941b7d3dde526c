// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <memory>
#include <string>

#include <prometheus/registry.h>

#include "services/base/status.h"

namespace prometheus {
class Exposer;
}

namespace vorocast::telemetry {

/// Answers GET /metrics over HTTP in Prometheus's text format, from threads of its own.
class MetricsServer {
 public:
  /// `listen`: HOST:PORT, where HOST is an IPv4 address or localhost, or a port alone for 127.0.0.1; port 0 for any free one.
  /// INVALID_ARGUMENT for another form, UNAVAILABLE when the port cannot be had.
  static absl::StatusOr<std::unique_ptr<MetricsServer>> Start(const std::string& listen, std::shared_ptr<prometheus::Registry> registry);
  ~MetricsServer();

  /// HOST:PORT as it is.
  const std::string& address() const { return address_; }

 private:
  MetricsServer(std::unique_ptr<prometheus::Exposer> exposer, std::shared_ptr<prometheus::Registry> registry, std::string address);

  std::shared_ptr<prometheus::Registry> registry_;
  std::unique_ptr<prometheus::Exposer> exposer_;
  std::string address_;
};

/// HOST:PORT with both parts checked and HOST in numbers.
absl::StatusOr<std::string> ParseMetricsAddress(const std::string& listen);

/// Adds vorocast_build_info{version,process} 1.
void AddBuildInformation(prometheus::Registry& registry, const std::string& process);

}  // namespace vorocast::telemetry
