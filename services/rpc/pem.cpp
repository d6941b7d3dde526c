// SPDX-License-Identifier: AGPL-3.0-or-later
#include "services/rpc/pem.h"

#include <openssl/evp.h>
#include <openssl/pem.h>
#include <openssl/x509.h>

#include <cerrno>
#include <cstdio>
#include <cstring>
#include <memory>

#include <fmt/format.h>

namespace vorocast::rpc {
namespace {

struct CloseFile {
  void operator()(std::FILE* file) const { std::fclose(file); }
};
struct FreeCertificate {
  void operator()(X509* certificate) const { X509_free(certificate); }
};
struct FreeKey {
  void operator()(EVP_PKEY* key) const { EVP_PKEY_free(key); }
};
using File = std::unique_ptr<std::FILE, CloseFile>;
using Certificate = std::unique_ptr<X509, FreeCertificate>;
using Key = std::unique_ptr<EVP_PKEY, FreeKey>;

/// A key behind a pass phrase cannot be used by a service that nobody sits beside: never ask for one.
int NoPassPhrase(char*, int, int, void*) { return -1; }

absl::StatusOr<File> Open(const std::string& flag, const std::string& name) {
  File file(std::fopen(name.c_str(), "re"));
  if (!file) return absl::NotFoundError(fmt::format("{} {}: cannot be opened: {}", flag, name, std::strerror(errno)));
  return file;
}

absl::StatusOr<Certificate> ReadCertificate(const std::string& flag, const std::string& name) {
  ASSIGN_OR_RETURN(const File file, Open(flag, name));
  Certificate certificate(PEM_read_X509(file.get(), nullptr, NoPassPhrase, nullptr));
  if (!certificate) return absl::InvalidArgumentError(fmt::format("{} {}: holds no PEM certificate (-----BEGIN CERTIFICATE-----)", flag, name));
  return certificate;
}

}  // namespace

absl::Status CheckCertificates(const std::string& flag, const std::string& file) { return ReadCertificate(flag, file).status(); }

absl::Status CheckKeyPair(const std::string& certificate_flag, const std::string& certificate, const std::string& key_flag, const std::string& key) {
  if (certificate.empty() != key.empty()) {
    return absl::InvalidArgumentError(fmt::format("{} and {} go together: give both", certificate_flag, key_flag));
  }
  if (certificate.empty()) return absl::OkStatus();
  ASSIGN_OR_RETURN(const Certificate read, ReadCertificate(certificate_flag, certificate));
  ASSIGN_OR_RETURN(const File key_file, Open(key_flag, key));
  const Key private_key(PEM_read_PrivateKey(key_file.get(), nullptr, NoPassPhrase, nullptr));
  if (!private_key) {
    return absl::InvalidArgumentError(
        fmt::format("{} {}: holds no PEM private key without a pass phrase (-----BEGIN PRIVATE KEY-----)", key_flag, key));
  }
  if (X509_check_private_key(read.get(), private_key.get()) != 1) {
    return absl::InvalidArgumentError(fmt::format("{} {} is not the key of {} {}", key_flag, key, certificate_flag, certificate));
  }
  return absl::OkStatus();
}

}  // namespace vorocast::rpc
