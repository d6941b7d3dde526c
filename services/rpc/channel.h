// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <memory>
#include <string>
#include <vector>

#include <grpcpp/channel.h>

#include "services/base/status.h"
#include "services/rpc/security.h"

namespace vorocast::rpc {

/// "A,B" names several schedulers of one farm, one of which leads. Never empty; a list without commas has one element.
std::vector<std::string> SplitAddresses(const std::string& list);

/// A channel to "host:port" or "unix:/path", not yet connected. It finds out within five seconds that its peer has stopped answering and
/// connects again by itself, at most a second after the peer is back. Never goes through a proxy.
std::shared_ptr<grpc::Channel> Connect(const std::string& address);
/// The same with TLS and a token. Errors tell of a file that cannot be used, or of a token that would travel in clear over a network.
absl::StatusOr<std::shared_ptr<grpc::Channel>> Connect(const std::string& address, const ClientSecurity& security);

}  // namespace vorocast::rpc
