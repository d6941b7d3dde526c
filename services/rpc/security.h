// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <functional>
#include <memory>
#include <string>
#include <string_view>

#include "services/base/status.h"
#include "services/rpc/gate.h"

namespace grpc {
class ChannelCredentials;
class ServerCredentials;
}  // namespace grpc

namespace vorocast::rpc {

/// How a server is guarded: files, each optional. All but `tokens` are PEM. They are read again when they change.
struct ServerSecurity {
  std::string certificate;  // the server's own, with what leads up to the authority: TLS
  std::string key;
  std::string client_ca;  // clients must show a certificate of this authority: mutual TLS
  std::string tokens;     // who may do what (tokens.h)

  bool tls() const { return !certificate.empty(); }
};

/// A server's guard, opened: what StartServer takes.
struct ServerGuard {
  ServerSecurity security;
  std::shared_ptr<Gate> gate;  // null without tokens
  /// "unix:/path" in a folder that only this user can enter; whoever comes through it may do everything, without TLS or a token. Empty: there is
  /// none.
  std::string private_door;
};

/// Checks the files and opens the gate. INVALID_ARGUMENT or NOT_FOUND with the file and what to do. `log` as in Gate::Options.
absl::StatusOr<ServerGuard> OpenGuard(const ServerSecurity& security, std::function<void(const std::string&)> log);
/// The door that others enter by. INVALID_ARGUMENT for a guard that does not fit the address: TLS on a Unix socket, tokens in clear over a network.
absl::StatusOr<std::shared_ptr<grpc::ServerCredentials>> CredentialsOf(const std::string& listen, const ServerGuard& guard);

/// For the log, in one line: what guards the address.
std::string DescribeGuard(const std::string& listen, const ServerGuard& guard);
/// True when other machines reach the address and anybody there may do everything.
bool IsUnguarded(const std::string& listen, const ServerGuard& guard);

/// How a client connects: files, each optional.
struct ClientSecurity {
  bool tls = false;
  std::string ca;           // authorities to believe; empty: the system's
  std::string certificate;  // shown to a server that asks for one
  std::string key;
  std::string token_file;  // read at every call, so that it can be replaced
};
/// TLS, but never to a Unix socket. INVALID_ARGUMENT or NOT_FOUND as for a server.
absl::StatusOr<std::shared_ptr<grpc::ChannelCredentials>> CredentialsOf(const std::string& address, const ClientSecurity& security);
/// FAILED_PRECONDITION when a token would travel in clear over a network.
absl::Status CheckTokenMayBeSent(const std::string& address, const ClientSecurity& security);

/// A Unix socket, or a host that is this machine however its names are resolved: localhost, 127.…, [::1].
bool IsThisMachine(std::string_view address);

}  // namespace vorocast::rpc
