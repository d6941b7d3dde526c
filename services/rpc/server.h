// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <memory>
#include <string>
#include <vector>

#include <grpcpp/generic/async_generic_service.h>
#include <grpcpp/impl/service_type.h>
#include <grpcpp/server.h>

#include "absl/time/time.h"
#include "services/base/status.h"
#include "services/rpc/security.h"

namespace vorocast::rpc {

struct ServerOptions {
  std::string listen = "127.0.0.1:0";    // host:port, port 0 for any free one, or unix:/path
  std::vector<grpc::Service*> services;  // must outlive the server
  /// Takes every call that no service takes; must outlive the server. With it the health service says NOT_SERVING.
  grpc::CallbackGenericService* everything = nullptr;
  ServerGuard guard;  // by default nobody is asked who they are
};

/// A running gRPC server with reflection and the standard health service.
class Server {
 public:
  /// Stops at once.
  ~Server();

  /// What a client connects to: the listen address with the port that was chosen.
  const std::string& address() const { return address_; }
  /// For processes of this user on this machine: the guard's private door, or the address where there is none.
  const std::string& address_here() const { return address_here_; }
  /// Takes no new calls, gives those under way `grace` to end, then cancels them. May be called again, from any thread.
  void Stop(absl::Duration grace);

 private:
  friend absl::StatusOr<std::unique_ptr<Server>> StartServer(const ServerOptions& options);
  Server(std::unique_ptr<grpc::Server> server, std::string address, std::string address_here)
      : server_(std::move(server)), address_(std::move(address)), address_here_(std::move(address_here)) {}

  std::unique_ptr<grpc::Server> server_;
  std::string address_, address_here_;
};

/// INVALID_ARGUMENT for a guard that does not fit the address, UNAVAILABLE when the address is taken or cannot be listened on.
absl::StatusOr<std::unique_ptr<Server>> StartServer(const ServerOptions& options);

}  // namespace vorocast::rpc
