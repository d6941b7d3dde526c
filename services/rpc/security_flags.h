// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <string>
#include <vector>

#include <CLI/CLI.hpp>

#include "services/rpc/security.h"

namespace vorocast::rpc {

/// --server-certificate, --server-key, --client-ca, --tokens: the same in every program that listens. Each can be given by a variable of the
/// environment instead, VOROCAST_ and its name.
void AddServerSecurityFlags(CLI::App& program, ServerSecurity& security);

/// --tls, --tls-ca, --tls-certificate, --tls-key, --token-file: the same in every program that connects, and likewise in the environment.
class ClientSecurityFlags {
 public:
  void AddTo(CLI::App& program);
  /// After parsing. A file of TLS means TLS, unless --tls=false was given.
  ClientSecurity Get() const;

 private:
  ClientSecurity security_;
  CLI::Option* tls_ = nullptr;
};

/// The flags that give another program of this project the same.
std::vector<std::string> ArgumentsOf(const ServerSecurity& security);
std::vector<std::string> ArgumentsOf(const ClientSecurity& security);

}  // namespace vorocast::rpc
