// SPDX-License-Identifier: AGPL-3.0-or-later
#include "services/telemetry/metrics_server.h"

#include <arpa/inet.h>

#include <charconv>
#include <exception>

#include <fmt/format.h>
#include <prometheus/exposer.h>
#include <prometheus/gauge.h>

namespace vorocast::telemetry {
namespace {

/// One scrape at a time is usual; a second for whoever looks by hand.
constexpr std::size_t kThreads = 2;

}  // namespace

absl::StatusOr<std::string> ParseMetricsAddress(const std::string& listen) {
  const std::size_t colon = listen.rfind(':');
  std::string host = colon == std::string::npos || colon == 0 ? "127.0.0.1" : listen.substr(0, colon);
  if (host == "localhost") host = "127.0.0.1";
  const std::string port_text = colon == std::string::npos ? listen : listen.substr(colon + 1);
  int port = -1;
  const char* const end = port_text.data() + port_text.size();
  const auto [rest, error] = std::from_chars(port_text.data(), end, port);
  in_addr address{};
  if (error != std::errc() || rest != end || port < 0 || port > 65535 || inet_pton(AF_INET, host.c_str(), &address) != 1) {
    return absl::InvalidArgumentError(
        fmt::format("--metrics {}: give HOST:PORT with HOST in numbers (0.0.0.0 for all of this machine's addresses), or a port alone", listen));
  }
  return fmt::format("{}:{}", host, port);
}

absl::StatusOr<std::unique_ptr<MetricsServer>> MetricsServer::Start(const std::string& listen, std::shared_ptr<prometheus::Registry> registry) {
  ASSIGN_OR_RETURN(const std::string address, ParseMetricsAddress(listen));
  try {
    auto exposer = std::make_unique<prometheus::Exposer>(address, kThreads);
    exposer->RegisterCollectable(registry);
    const std::string actual = fmt::format("{}:{}", address.substr(0, address.rfind(':')), exposer->GetListeningPorts().at(0));
    return std::unique_ptr<MetricsServer>(new MetricsServer(std::move(exposer), std::move(registry), actual));
  } catch (const std::exception& problem) {
    return absl::UnavailableError(fmt::format("--metrics {}: cannot listen there: {}; is the port taken?", listen, problem.what()));
  }
}

MetricsServer::MetricsServer(std::unique_ptr<prometheus::Exposer> exposer, std::shared_ptr<prometheus::Registry> registry, std::string address)
    : registry_(std::move(registry)), exposer_(std::move(exposer)), address_(std::move(address)) {}
MetricsServer::~MetricsServer() = default;

void AddBuildInformation(prometheus::Registry& registry, const std::string& process) {
  prometheus::BuildGauge()
      .Name("vorocast_build_info")
      .Help("Which version runs; always 1")
      .Register(registry)
      .Add({{"version", VOROCAST_VERSION}, {"process", process}})
      .Set(1);
}

}  // namespace vorocast::telemetry
