// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <memory>
#include <mutex>
#include <string>

#include <grpcpp/generic/async_generic_service.h>

#include "services/base/status.h"
#include "services/rpc/server.h"

namespace vorocast::server {

/// What a scheduler that does not lead answers, whatever it is asked: UNAVAILABLE, and where the leader is. Who has several addresses goes on to
/// the next one.
class StandbyServer final : public grpc::CallbackGenericService {
 public:
  static absl::StatusOr<std::unique_ptr<StandbyServer>> Start(const std::string& listen, const rpc::ServerGuard& guard);

  /// What to listen on when this one has ended: the port is chosen.
  const std::string& address() const { return server_->address(); }
  void SetLeader(const std::string& address);

  grpc::ServerGenericBidiReactor* CreateReactor(grpc::GenericCallbackServerContext* context) override;

 private:
  StandbyServer() = default;

  std::mutex mutex_;
  std::string leader_;  // guarded by mutex_
  std::unique_ptr<rpc::Server> server_;
};

}  // namespace vorocast::server
