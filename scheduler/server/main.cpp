// SPDX-License-Identifier: AGPL-3.0-or-later
#include <signal.h>
#include <unistd.h>

#include <cstdio>
#include <filesystem>
#include <fstream>
#include <memory>
#include <optional>
#include <string>

#include <fmt/format.h>
#include <spdlog/spdlog.h>
#include <CLI/CLI.hpp>
#include <nlohmann/json.hpp>

#include "scheduler/fleet/fleet_flags.h"
#include "scheduler/server/collector_flags.h"
#include "scheduler/server/scheduler_server.h"
#include "scheduler/server/standby.h"
#include "scheduler/store/postgres_store.h"
#include "services/base/processor.h"
#include "services/rpc/security_flags.h"
#include "services/telemetry/telemetry_flags.h"

namespace vorocast::server {
namespace {

struct Options {
  std::string state;
  std::string database;
  std::string listen;
  rpc::ServerSecurity security;
  fleet::FleetFlags fleet;
  telemetry::TelemetryFlags telemetry;
  CollectorFlags collector;
};

constexpr std::size_t kUnixPathMax = 107;

/// The same at every start on one folder, so that workers that outlived a scheduler find the next one.
std::string StableAddress(const std::filesystem::path& state) {
  const std::string socket = (state / "scheduler.sock").string();
  if (socket.size() <= kUnixPathMax) return "unix:" + socket;
  std::ifstream file(state / "scheduler.json");
  const auto announced = nlohmann::json::parse(file, nullptr, false);
  if (announced.is_object() && announced.contains("address") && announced["address"].is_string()) {
    const std::string address = announced["address"];
    if (address.starts_with("127.0.0.1:")) return address;
  }
  return "127.0.0.1:0";
}

absl::Status Announce(const std::filesystem::path& state, const std::string& address) {
  const std::filesystem::path path = state / "scheduler.json";
  const std::filesystem::path temporary = state / "scheduler.json.new";
  std::ofstream file(temporary);
  file << nlohmann::json{{"address", address}, {"pid", getpid()}}.dump() << "\n";
  file.close();
  if (file.fail()) return absl::UnavailableError(fmt::format("{}: cannot be written; is the disk full?", temporary.string()));
  std::error_code error;
  std::filesystem::rename(temporary, path, error);
  if (error) return absl::UnavailableError(fmt::format("{}: cannot be written: {}", path.string(), error.message()));
  return absl::OkStatus();
}

/// A socket in a folder that only this user can enter: workers of this machine and 'vorocast status --state' use it. Of this host, because several
/// may share the state folder.
absl::StatusOr<std::string> PrivateDoor(const std::filesystem::path& state) {
  char host[256] = {};
  if (gethostname(host, sizeof host - 1) != 0) return "";
  const std::filesystem::path folder = state / "private";
  std::error_code error;
  std::filesystem::create_directories(folder, error);
  if (!error) std::filesystem::permissions(folder, std::filesystem::perms::owner_all, error);
  if (error) return absl::UnavailableError(fmt::format("{}: cannot be made private: {}", folder.string(), error.message()));
  const std::string socket = (folder / fmt::format("{}.sock", host)).string();
  if (socket.size() <= kUnixPathMax) return "unix:" + socket;
  spdlog::warn("{}: too long for a socket; workers of this machine need a token and --tls-ca like all others", socket);
  return "";
}

absl::StatusOr<rpc::ServerGuard> OpenGuard(const Options& options, const std::filesystem::path& state, const std::string& listen) {
  rpc::ServerSecurity security = options.security;
  // What no other machine reaches needs no certificate.
  if (options.listen.empty()) security = {.tokens = options.security.tokens};
  ASSIGN_OR_RETURN(rpc::ServerGuard guard, rpc::OpenGuard(security, [](const std::string& text) { spdlog::warn("{}", text); }));
  if (guard.gate || guard.security.tls()) {
    ASSIGN_OR_RETURN(guard.private_door, PrivateDoor(state));
  }
  spdlog::info("door: address={} guard=\"{}\"", listen, rpc::DescribeGuard(listen, guard));
  if (rpc::IsUnguarded(listen, guard)) {
    spdlog::warn(
        "whoever reaches {} may submit, cancel and fetch, and take tasks: it asks for neither tokens nor client certificates; see 'Who may do "
        "what' in docs/operations.md",
        listen);
  }
  return guard;
}

absl::Status Serve(const Options& options, const sigset_t& stop_signals) {
  const std::filesystem::path state = std::filesystem::absolute(options.state).lexically_normal();
  RETURN_IF_ERROR(options.telemetry.StartLog("scheduler", state / "logs" / "scheduler.log"));
  const std::string listen = options.listen.empty() ? StableAddress(state) : options.listen;
  ASSIGN_OR_RETURN(const rpc::ServerGuard guard, OpenGuard(options, state, listen));
  std::unique_ptr<SchedulerServer> server;
  if (options.database.empty()) {
    ASSIGN_OR_RETURN(server, SchedulerServer::Start({.state = state, .listen = listen, .guard = guard, .collection = options.collector.Parse()}));
  } else {
    ASSIGN_OR_RETURN(std::unique_ptr<store::Store> store, store::OpenPostgresStore(options.database));
    ASSIGN_OR_RETURN(const std::optional<std::string> address, AwaitLeadership(*store, listen, guard, stop_signals));
    if (!address) return absl::OkStatus();
    ASSIGN_OR_RETURN(server, SchedulerServer::Start({.state = state, .listen = *address, .guard = guard, .collection = options.collector.Parse()},
                                                    std::move(store)));
  }
  ASSIGN_OR_RETURN(const auto metrics, options.telemetry.StartMetrics(server->metrics()));
  ASSIGN_OR_RETURN(
      std::vector<std::unique_ptr<fleet::Fleet>> fleets,
      options.fleet.Start(state, {.here = server->address_here(), .elsewhere = server->address()}, [raw = server.get()] { return raw->Demand(); }));
  RETURN_IF_ERROR(Announce(state, server->address_here()));
  server->DescribeFleet([&fleets] { return fleet::Describe(fleets); });
  spdlog::info("serving: address={} state={} pid={}", server->address(), state.string(), getpid());
  int signal = 0;
  sigwait(&stop_signals, &signal);
  spdlog::info("stopping: signal={}", signal);
  server->DescribeFleet(nullptr);
  fleets.clear();
  server.reset();
  std::error_code ignored;
  if (!StableAddress(state).starts_with("127.")) std::filesystem::remove(state / "scheduler.json", ignored);
  spdlog::info("stopped");
  return absl::OkStatus();
}

absl::Status Validate(const Options& options) {
  RETURN_IF_ERROR(options.fleet.Validate(options.listen));
  if (options.database.empty() || !options.listen.empty()) return absl::OkStatus();
  return absl::InvalidArgumentError("--database needs --listen HOST:PORT: a scheduler that stands by has an address of its own");
}

int Main(int argc, char** argv) {
  // Before any thread starts, so that all of them leave these signals to sigwait.
  sigset_t stop_signals;
  sigemptyset(&stop_signals);
  sigaddset(&stop_signals, SIGTERM);
  sigaddset(&stop_signals, SIGINT);
  pthread_sigmask(SIG_BLOCK, &stop_signals, nullptr);
  signal(SIGPIPE, SIG_IGN);

  CLI::App app("Vorocast's scheduler: splits takes into tasks and leases them to workers");
  Options options;
  app.add_option("--state", options.state, "Folder for the database, the artifacts and the logs; created if need be")->required();
  app.add_option("--database", options.database,
                 "postgresql://USER@HOST/NAME (default: SQLite in the state folder). Several schedulers may name one database and share the state "
                 "folder: one leads, the others stand by. The password comes from ~/.pgpass or PGPASSWORD");
  app.add_option("--listen", options.listen, "HOST:PORT or unix:/path (default: a socket in the state folder)");
  rpc::AddServerSecurityFlags(app, options.security);
  options.fleet.AddTo(app);
  options.telemetry.AddTo(app);
  options.collector.AddTo(app);
  CLI11_PARSE(app, argc, argv);

  absl::Status status = Validate(options);
  if (status.ok()) status = Serve(options, stop_signals);
  if (status.ok()) return 0;
  fmt::print(stderr, "vorocast-scheduler: {}\n", std::string(status.message()));
  return 1;
}

}  // namespace
}  // namespace vorocast::server

int main(int argc, char** argv) {
  vorocast::base::RequireProcessor();
  return vorocast::server::Main(argc, argv);
}
