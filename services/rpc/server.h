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

namespace vorocast::rpc {

struct ServerOptions {
  std::string listen = "127.0.0.1:0";    // host:port, port 0 for any free one, or unix:/path
  std::vector<grpc::Service*> services;  // must outlive the server
  /// Takes every call that no service takes; must outlive the server. With it the health service says NOT_SERVING.
  grpc::CallbackGenericService* everything = nullptr;
};

/// A running gRPC server with reflection and the standard health service.
class Server {
 public:
  /// Stops at once.
  ~Server();

  /// What a client connects to: the listen address with the port that was chosen.
  const std::string& address() const { return address_; }
  /// Takes no new calls, gives those under way `grace` to end, then cancels them. May be called again, from any thread.
  void Stop(absl::Duration grace);

 private:
  friend absl::StatusOr<std::unique_ptr<Server>> StartServer(const ServerOptions& options);
  Server(std::unique_ptr<grpc::Server> server, std::string address) : server_(std::move(server)), address_(std::move(address)) {}

  std::unique_ptr<grpc::Server> server_;
  std::string address_;
};

/// UNAVAILABLE when the address is taken or cannot be listened on.
absl::StatusOr<std::unique_ptr<Server>> StartServer(const ServerOptions& options);

}  // namespace vorocast::rpc
