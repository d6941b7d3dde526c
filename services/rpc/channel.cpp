// SPDX-License-Identifier: AGPL-3.0-or-later
#include "services/rpc/channel.h"

#include <algorithm>

#include <grpcpp/create_channel.h>
#include <grpcpp/security/credentials.h>
#include <grpcpp/support/channel_arguments.h>
#include <grpcpp/support/client_interceptor.h>

#include "services/rpc/limits.h"
#include "services/rpc/tokens.h"

namespace vorocast::rpc {
namespace {

/// Puts the token into every call. Where its file cannot be read, the call goes without, and the server says what is missing.
class TokenSender final : public grpc::experimental::Interceptor {
 public:
  explicit TokenSender(std::string file) : file_(std::move(file)) {}
  void Intercept(grpc::experimental::InterceptorBatchMethods* methods) override {
    if (methods->QueryInterceptionHookPoint(grpc::experimental::InterceptionHookPoints::PRE_SEND_INITIAL_METADATA)) {
      if (const auto token = ReadToken(file_); token.ok()) methods->GetSendInitialMetadata()->insert({"authorization", Authorization(*token)});
    }
    methods->Proceed();
  }

 private:
  const std::string file_;
};

class TokenSenders final : public grpc::experimental::ClientInterceptorFactoryInterface {
 public:
  explicit TokenSenders(std::string file) : file_(std::move(file)) {}
  grpc::experimental::Interceptor* CreateClientInterceptor(grpc::experimental::ClientRpcInfo*) override { return new TokenSender(file_); }

 private:
  const std::string file_;
};

}  // namespace

std::vector<std::string> SplitAddresses(const std::string& list) {
  std::vector<std::string> addresses;
  for (std::size_t first = 0; first <= list.size();) {
    const std::size_t comma = std::min(list.find(',', first), list.size());
    if (comma > first) addresses.push_back(list.substr(first, comma - first));
    first = comma + 1;
  }
  if (addresses.empty()) addresses.push_back(list);
  return addresses;
}

std::shared_ptr<grpc::Channel> Connect(const std::string& address) { return *Connect(address, ClientSecurity{}); }

absl::StatusOr<std::shared_ptr<grpc::Channel>> Connect(const std::string& address, const ClientSecurity& security) {
  RETURN_IF_ERROR(CheckTokenMayBeSent(address, security));
  ASSIGN_OR_RETURN(const std::shared_ptr<grpc::ChannelCredentials> credentials, CredentialsOf(address, security));
  std::vector<std::unique_ptr<grpc::experimental::ClientInterceptorFactoryInterface>> interceptors;
  if (!security.token_file.empty()) {
    RETURN_IF_ERROR(ReadToken(security.token_file).status());
    interceptors.push_back(std::make_unique<TokenSenders>(security.token_file));
  }
  grpc::ChannelArguments arguments;
  arguments.SetInt(GRPC_ARG_KEEPALIVE_TIME_MS, kKeepaliveMs);
  arguments.SetInt(GRPC_ARG_KEEPALIVE_TIMEOUT_MS, kKeepaliveMs);
  arguments.SetInt(GRPC_ARG_KEEPALIVE_PERMIT_WITHOUT_CALLS, 1);
  arguments.SetInt(GRPC_ARG_HTTP2_MAX_PINGS_WITHOUT_DATA, 0);
  arguments.SetInt(GRPC_ARG_INITIAL_RECONNECT_BACKOFF_MS, 100);
  arguments.SetInt(GRPC_ARG_MIN_RECONNECT_BACKOFF_MS, 1000);
  arguments.SetInt(GRPC_ARG_MAX_RECONNECT_BACKOFF_MS, 1000);
  arguments.SetInt(GRPC_ARG_ENABLE_HTTP_PROXY, 0);
  // Channels of one process must not share a connection, or a worker that connects again could be given the broken one.
  arguments.SetInt(GRPC_ARG_USE_LOCAL_SUBCHANNEL_POOL, 1);
  arguments.SetMaxReceiveMessageSize(kMessageBytesMax);
  arguments.SetMaxSendMessageSize(kMessageBytesMax);
  return grpc::experimental::CreateCustomChannelWithInterceptors(address, credentials, arguments, std::move(interceptors));
}

}  // namespace vorocast::rpc
