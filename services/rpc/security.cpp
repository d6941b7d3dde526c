// SPDX-License-Identifier: AGPL-3.0-or-later
#include "services/rpc/security.h"

#include <utility>
#include <vector>

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <grpcpp/security/auth_metadata_processor.h>
#include <grpcpp/security/credentials.h>
#include <grpcpp/security/server_credentials.h>
#include <grpcpp/security/tls_certificate_provider.h>
#include <grpcpp/security/tls_credentials_options.h>

#include "services/rpc/pem.h"
#include "services/rpc/status.h"

namespace vorocast::rpc {
namespace {

/// How often certificates are looked at for a change.
constexpr unsigned kCertificateLookSeconds = 10;
constexpr std::string_view kUnixPrefix = "unix:";

bool IsUnix(std::string_view address) { return address.starts_with(kUnixPrefix); }

std::string_view Text(const grpc::string_ref& text) { return {text.data(), text.size()}; }

/// gRPC asks it at every call of every service, known or unknown, before a handler sees the call.
class GateKeeper final : public grpc::AuthMetadataProcessor {
 public:
  GateKeeper(std::shared_ptr<Gate> gate, std::string door) : gate_(std::move(gate)), door_(std::move(door)) {}

  bool IsBlocking() const override { return false; }

  grpc::Status Process(const InputMetadata& metadata, grpc::AuthContext* connection, OutputMetadata*, OutputMetadata*) override {
    const auto field = [&](const char* name) {
      const auto entry = metadata.find(name);
      return entry == metadata.end() ? std::string_view() : Text(entry->second);
    };
    return ToGrpc(gate_->Admit(field(":path"), field("authorization"), Peer(*connection, field("user-agent"))));
  }

 private:
  /// gRPC tells this place who holds the connection's certificate and what program calls, but not its address.
  std::string Peer(const grpc::AuthContext& connection, std::string_view program) const {
    std::string certificate;
    for (const grpc::string_ref& name : connection.FindPropertyValues("x509_common_name")) certificate = Text(name);
    return fmt::format("{} door={} certificate={}", program, door_, certificate.empty() ? "none" : certificate);
  }

  const std::shared_ptr<Gate> gate_;
  const std::string door_;
};

std::shared_ptr<grpc::experimental::CertificateProviderInterface> WatchFiles(const std::string& certificate, const std::string& key,
                                                                             const std::string& ca) {
  return std::make_shared<grpc::experimental::FileWatcherCertificateProvider>(key, certificate, ca, kCertificateLookSeconds);
}

std::shared_ptr<grpc::ServerCredentials> TlsServer(const ServerSecurity& security) {
  grpc::experimental::TlsServerCredentialsOptions options(WatchFiles(security.certificate, security.key, security.client_ca));
  options.watch_identity_key_cert_pairs();
  if (security.client_ca.empty()) {
    options.set_cert_request_type(GRPC_SSL_DONT_REQUEST_CLIENT_CERTIFICATE);
  } else {
    options.watch_root_certs();
    options.set_cert_request_type(GRPC_SSL_REQUEST_AND_REQUIRE_CLIENT_CERTIFICATE_AND_VERIFY);
  }
  return grpc::experimental::TlsServerCredentials(options);
}

}  // namespace

bool IsThisMachine(std::string_view address) {
  if (IsUnix(address)) return true;
  const std::string_view host = address.substr(0, address.rfind(':'));
  if (host == "localhost" || host == "[::1]" || host == "::1") return true;
  // 127.attacker.example is a name, not an address.
  return host.starts_with("127.") && host.find_first_not_of("0123456789.") == std::string_view::npos;
}

absl::StatusOr<ServerGuard> OpenGuard(const ServerSecurity& security, std::function<void(const std::string&)> log) {
  RETURN_IF_ERROR(CheckKeyPair("--server-certificate", security.certificate, "--server-key", security.key));
  if (!security.client_ca.empty()) {
    if (!security.tls()) return absl::InvalidArgumentError("--client-ca needs --server-certificate and --server-key");
    RETURN_IF_ERROR(CheckCertificates("--client-ca", security.client_ca));
  }
  ServerGuard guard{.security = security, .gate = nullptr, .private_door = ""};
  if (!security.tokens.empty()) {
    auto gate = Gate::Open({.tokens = security.tokens, .log = std::move(log)});
    if (!gate.ok()) return base::Annotate(gate.status(), "--tokens");
    guard.gate = *std::move(gate);
  }
  return guard;
}

absl::StatusOr<std::shared_ptr<grpc::ServerCredentials>> CredentialsOf(const std::string& listen, const ServerGuard& guard) {
  std::shared_ptr<grpc::ServerCredentials> credentials;
  if (IsUnix(listen)) {
    if (guard.security.tls()) {
      return absl::InvalidArgumentError(fmt::format("{}: a Unix socket has no TLS; leave --server-certificate out, or listen on HOST:PORT", listen));
    }
    if (!guard.gate) return grpc::InsecureServerCredentials();
    credentials = grpc::experimental::LocalServerCredentials(UDS);
  } else if (guard.security.tls()) {
    credentials = TlsServer(guard.security);
  } else if (!guard.gate) {
    return grpc::InsecureServerCredentials();
  } else if (IsThisMachine(listen)) {
    credentials = grpc::experimental::LocalServerCredentials(LOCAL_TCP);
  } else {
    return absl::InvalidArgumentError(
        fmt::format("{}: tokens would travel in clear over the network; --tokens needs --server-certificate and --server-key there", listen));
  }
  if (guard.gate) credentials->SetAuthMetadataProcessor(std::make_shared<GateKeeper>(guard.gate, listen));
  return credentials;
}

std::string DescribeGuard(const std::string& listen, const ServerGuard& guard) {
  std::vector<std::string> parts;
  if (guard.security.tls()) parts.push_back(guard.security.client_ca.empty() ? "TLS" : "TLS with client certificates");
  if (guard.gate) parts.push_back("tokens");
  if (!parts.empty()) return fmt::format("{}", fmt::join(parts, ", "));
  return IsThisMachine(listen) ? "none, for processes of this machine only" : "none";
}

bool IsUnguarded(const std::string& listen, const ServerGuard& guard) {
  return !IsThisMachine(listen) && !guard.gate && guard.security.client_ca.empty();
}

absl::StatusOr<std::shared_ptr<grpc::ChannelCredentials>> CredentialsOf(const std::string& address, const ClientSecurity& security) {
  if (!security.tls || IsUnix(address)) return grpc::InsecureChannelCredentials();
  RETURN_IF_ERROR(CheckKeyPair("--tls-certificate", security.certificate, "--tls-key", security.key));
  if (!security.ca.empty()) RETURN_IF_ERROR(CheckCertificates("--tls-ca", security.ca));
  grpc::experimental::TlsChannelCredentialsOptions options;
  if (!security.ca.empty() || !security.certificate.empty()) {
    options.set_certificate_provider(WatchFiles(security.certificate, security.key, security.ca));
  }
  if (!security.ca.empty()) options.watch_root_certs();
  if (!security.certificate.empty()) options.watch_identity_key_cert_pairs();
  options.set_certificate_verifier(std::make_shared<grpc::experimental::HostNameCertificateVerifier>());
  return grpc::experimental::TlsCredentials(options);
}

absl::Status CheckTokenMayBeSent(const std::string& address, const ClientSecurity& security) {
  if (security.token_file.empty() || security.tls || IsThisMachine(address)) return absl::OkStatus();
  return absl::FailedPreconditionError(fmt::format("{}: a token is not sent in clear over a network; give --tls or --tls-ca too", address));
}

}  // namespace vorocast::rpc
