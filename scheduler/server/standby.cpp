// SPDX-License-Identifier: AGPL-3.0-or-later
#include "scheduler/server/standby.h"

#include <unistd.h>

#include <ctime>

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include "scheduler/server/standby_server.h"

namespace vorocast::server {
namespace {

constexpr timespec kPeriod = {.tv_sec = 0, .tv_nsec = 200'000'000};

}  // namespace

std::string AddressForOthers(const std::string& listen) {
  const std::size_t colon = listen.rfind(':');
  if (colon == std::string::npos || (listen.substr(0, colon) != "0.0.0.0" && listen.substr(0, colon) != "[::]")) return listen;
  char host[256] = {};
  if (gethostname(host, sizeof host - 1) != 0) return listen;
  return fmt::format("{}:{}", host, listen.substr(colon + 1));
}

absl::StatusOr<std::optional<std::string>> AwaitLeadership(store::Store& store, const std::string& listen, const rpc::ServerGuard& guard,
                                                           const sigset_t& stop_signals) {
  ASSIGN_OR_RETURN(const std::unique_ptr<StandbyServer> standby, StandbyServer::Start(listen, guard));
  std::string said;
  while (true) {
    const auto term = store.Lead(AddressForOthers(standby->address()));
    if (term.ok()) {
      spdlog::info("leading: term={} address={}", *term, standby->address());
      return standby->address();
    }
    const bool waits = absl::IsFailedPrecondition(term.status()) && !store.LeaderAddress().empty();
    if (!waits && !absl::IsUnavailable(term.status()) && !absl::IsResourceExhausted(term.status())) return term.status();
    standby->SetLeader(store.LeaderAddress());
    if (std::string why(term.status().message()); why != said) {
      spdlog::info("standing by: address={} reason=\"{}\"", standby->address(), why);
      said = std::move(why);
    }
    if (sigtimedwait(&stop_signals, nullptr, &kPeriod) > 0) return std::nullopt;
  }
}

}  // namespace vorocast::server
