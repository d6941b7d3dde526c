// SPDX-License-Identifier: AGPL-3.0-or-later
#include "services/rpc/security_flags.h"

namespace vorocast::rpc {
namespace {

constexpr char kServerGroup[] = "Who may connect (docs/operations.md)";
constexpr char kClientGroup[] = "How to connect (docs/operations.md)";

void AddUnlessEmpty(std::vector<std::string>& arguments, const char* flag, const std::string& value) {
  if (!value.empty()) arguments.insert(arguments.end(), {flag, value});
}

}  // namespace

void AddServerSecurityFlags(CLI::App& program, ServerSecurity& security) {
  program
      .add_option("--server-certificate", security.certificate, "PEM file: this server's certificate, and those between it and its authority. TLS")
      ->envname("VOROCAST_SERVER_CERTIFICATE")
      ->group(kServerGroup);
  program.add_option("--server-key", security.key, "PEM file: its private key")->envname("VOROCAST_SERVER_KEY")->group(kServerGroup);
  program.add_option("--client-ca", security.client_ca, "PEM file: clients must show a certificate of this authority")
      ->envname("VOROCAST_CLIENT_CA")
      ->group(kServerGroup);
  program
      .add_option("--tokens", security.tokens, "File of who may do what, a line each as 'vorocast token new' prints it; read again when it changes")
      ->envname("VOROCAST_TOKENS")
      ->group(kServerGroup);
}

void ClientSecurityFlags::AddTo(CLI::App& program) {
  tls_ = program.add_flag("--tls", security_.tls, "Connect with TLS; any of the --tls-… files means it too")
             ->envname("VOROCAST_TLS")
             ->group(kClientGroup);
  program.add_option("--tls-ca", security_.ca, "PEM file: authorities whose servers are believed (the system's)")
      ->envname("VOROCAST_TLS_CA")
      ->group(kClientGroup);
  program.add_option("--tls-certificate", security_.certificate, "PEM file: the certificate to show to a server that asks for one")
      ->envname("VOROCAST_TLS_CERTIFICATE")
      ->group(kClientGroup);
  program.add_option("--tls-key", security_.key, "PEM file: its private key")->envname("VOROCAST_TLS_KEY")->group(kClientGroup);
  program.add_option("--token-file", security_.token_file, "File whose first line is the token to show")
      ->envname("VOROCAST_TOKEN_FILE")
      ->group(kClientGroup);
}

ClientSecurity ClientSecurityFlags::Get() const {
  ClientSecurity security = security_;
  const bool said = tls_ && tls_->count() > 0;
  if (!said) security.tls = !security.ca.empty() || !security.certificate.empty();
  return security;
}

std::vector<std::string> ArgumentsOf(const ServerSecurity& security) {
  std::vector<std::string> arguments;
  AddUnlessEmpty(arguments, "--server-certificate", security.certificate);
  AddUnlessEmpty(arguments, "--server-key", security.key);
  AddUnlessEmpty(arguments, "--client-ca", security.client_ca);
  AddUnlessEmpty(arguments, "--tokens", security.tokens);
  return arguments;
}

std::vector<std::string> ArgumentsOf(const ClientSecurity& security) {
  std::vector<std::string> arguments;
  if (security.tls) arguments.push_back("--tls");
  AddUnlessEmpty(arguments, "--tls-ca", security.ca);
  AddUnlessEmpty(arguments, "--tls-certificate", security.certificate);
  AddUnlessEmpty(arguments, "--tls-key", security.key);
  AddUnlessEmpty(arguments, "--token-file", security.token_file);
  return arguments;
}

}  // namespace vorocast::rpc
