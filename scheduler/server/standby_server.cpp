// SPDX-License-Identifier: AGPL-3.0-or-later
#include "scheduler/server/standby_server.h"

#include <fmt/format.h>

namespace vorocast::server {
namespace {

class Refusal final : public grpc::ServerGenericBidiReactor {
 public:
  explicit Refusal(const std::string& message) { Finish(grpc::Status(grpc::StatusCode::UNAVAILABLE, message)); }
  void OnDone() override { delete this; }
};

}  // namespace

absl::StatusOr<std::unique_ptr<StandbyServer>> StandbyServer::Start(const std::string& listen, const rpc::ServerGuard& guard) {
  std::unique_ptr<StandbyServer> standby(new StandbyServer);
  ASSIGN_OR_RETURN(standby->server_, rpc::StartServer({.listen = listen, .everything = standby.get(), .guard = guard}));
  return standby;
}

void StandbyServer::SetLeader(const std::string& address) {
  const std::lock_guard lock(mutex_);
  leader_ = address;
}

grpc::ServerGenericBidiReactor* StandbyServer::CreateReactor(grpc::GenericCallbackServerContext*) {
  const std::lock_guard lock(mutex_);
  return new Refusal(fmt::format("this scheduler stands by and does not lead{}", leader_.empty() ? "" : "; the leader is at " + leader_));
}

}  // namespace vorocast::server
