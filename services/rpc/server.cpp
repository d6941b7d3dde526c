// SPDX-License-Identifier: AGPL-3.0-or-later
#include "services/rpc/server.h"

#include <mutex>

#include <fmt/format.h>
#include <grpcpp/ext/proto_server_reflection_plugin.h>
#include <grpcpp/health_check_service_interface.h>
#include <grpcpp/resource_quota.h>
#include <grpcpp/security/server_credentials.h>
#include <grpcpp/server_builder.h>

#include "absl/time/clock.h"
#include "services/rpc/limits.h"

namespace vorocast::rpc {
namespace {

constexpr std::string_view kUnixPrefix = "unix:";
constexpr std::size_t kUnixPathMax = 107;  // sockaddr_un holds 108 bytes with the terminating zero

void EnablePlugins() {
  static std::once_flag once;
  std::call_once(once, [] {
    grpc::EnableDefaultHealthCheckService(true);
    grpc::reflection::InitProtoReflectionServerBuilderPlugin();
  });
}

absl::Status CheckUnixPath(const std::string& address) {
  if (!address.starts_with(kUnixPrefix) || address.size() - kUnixPrefix.size() <= kUnixPathMax) return absl::OkStatus();
  return absl::InvalidArgumentError(
      fmt::format("{}: a Unix socket's path has at most {} bytes; use a shorter path or 127.0.0.1:0", address, kUnixPathMax));
}

std::string WithPort(const std::string& listen, int port) {
  if (listen.starts_with(kUnixPrefix)) return listen;
  return fmt::format("{}:{}", listen.substr(0, listen.rfind(':')), port);
}

}  // namespace

Server::~Server() { Stop(absl::ZeroDuration()); }

void Server::Stop(absl::Duration grace) { server_->Shutdown(absl::ToChronoTime(absl::Now() + grace)); }

absl::StatusOr<std::unique_ptr<Server>> StartServer(const ServerOptions& options) {
  const std::string& private_door = options.guard.private_door;
  for (const std::string& address : {options.listen, private_door}) RETURN_IF_ERROR(CheckUnixPath(address));
  ASSIGN_OR_RETURN(const std::shared_ptr<grpc::ServerCredentials> credentials, CredentialsOf(options.listen, options.guard));
  EnablePlugins();
  grpc::ServerBuilder builder;
  int port = 0;
  int private_port = 1;
  builder.AddListeningPort(options.listen, credentials, &port);
  if (!private_door.empty()) builder.AddListeningPort(private_door, grpc::InsecureServerCredentials(), &private_port);
  // Without this two servers may listen on one port, and each gets some of the calls.
  builder.AddChannelArgument(GRPC_ARG_ALLOW_REUSEPORT, 0);
  builder.AddChannelArgument(GRPC_ARG_KEEPALIVE_TIME_MS, kKeepaliveMs);
  builder.AddChannelArgument(GRPC_ARG_KEEPALIVE_TIMEOUT_MS, kKeepaliveMs);
  builder.AddChannelArgument(GRPC_ARG_KEEPALIVE_PERMIT_WITHOUT_CALLS, 1);
  builder.AddChannelArgument(GRPC_ARG_HTTP2_MAX_PINGS_WITHOUT_DATA, 0);
  builder.AddChannelArgument(GRPC_ARG_HTTP2_MIN_RECV_PING_INTERVAL_WITHOUT_DATA_MS, kKeepaliveMs / 2);
  builder.AddChannelArgument(GRPC_ARG_HTTP2_MAX_PING_STRIKES, 0);
  builder.AddChannelArgument(GRPC_ARG_MAX_CONCURRENT_STREAMS, kStreamsMax);
  builder.AddChannelArgument(GRPC_ARG_MAX_METADATA_SIZE, kMetadataBytesMax);
  builder.SetResourceQuota(grpc::ResourceQuota("server").Resize(kServerBufferBytes).SetMaxThreads(kServerThreadsMax));
  builder.SetMaxReceiveMessageSize(kMessageBytesMax);
  builder.SetMaxSendMessageSize(kMessageBytesMax);
  for (grpc::Service* service : options.services) builder.RegisterService(service);
  if (options.everything) builder.RegisterCallbackGenericService(options.everything);
  std::unique_ptr<grpc::Server> server = builder.BuildAndStart();
  if (!server || port == 0 || private_port == 0) {
    return absl::UnavailableError(
        fmt::format("{}: cannot be listened on; another process may hold it, or the host or folder is wrong", options.listen));
  }
  if (options.everything) server->GetHealthCheckService()->SetServingStatus(false);
  std::string address = WithPort(options.listen, port);
  std::string address_here = private_door.empty() ? address : private_door;
  return std::unique_ptr<Server>(new Server(std::move(server), std::move(address), std::move(address_here)));
}

}  // namespace vorocast::rpc
