// SPDX-License-Identifier: AGPL-3.0-or-later
#include "tests/support/certificates.h"

#include <stdlib.h>

#include <fmt/format.h>

#include "services/base/check.h"

namespace vorocast::support {
namespace {

constexpr char kNewKey[] = "-newkey ec -pkeyopt ec_paramgen_curve:prime256v1 -nodes";

void Run(const std::filesystem::path& folder, const std::string& arguments) {
  const std::string command = fmt::format("cd '{}' && openssl {} 2>> openssl.log", folder.string(), arguments);
  VOROCAST_CHECK(::system(command.c_str()) == 0);
}

void MakeAuthority(const std::filesystem::path& folder, const std::string& name) {
  Run(folder, fmt::format("req -x509 {} -days 3650 -subj '/CN={}' -keyout {}.key -out {}.pem", kNewKey, name, name, name));
}

void MakeSigned(const std::filesystem::path& folder, const std::string& name, const std::string& authority, int days) {
  Run(folder, fmt::format("req {} -subj '/CN={}' -addext \"subjectAltName=DNS:localhost,DNS:$(hostname),IP:127.0.0.1\" -keyout {}.key -out {}.csr",
                          kNewKey, name, name, name));
  Run(folder, fmt::format("x509 -req -in {}.csr -CA {}.pem -CAkey {}.key -CAcreateserial -days {} -copy_extensions copy -out {}.pem", name, authority,
                          authority, days, name));
}

}  // namespace

TestCertificates::TestCertificates() {
  std::string pattern = (std::filesystem::temp_directory_path() / "certificates.XXXXXX").string();
  VOROCAST_CHECK(::mkdtemp(pattern.data()) != nullptr);
  folder_ = pattern;
  MakeAuthority(folder_, "ca");
  MakeAuthority(folder_, "stranger");
  MakeSigned(folder_, "server", "ca", 365);
  MakeSigned(folder_, "expired", "ca", -1);
  MakeSigned(folder_, "client", "ca", 365);
  MakeSigned(folder_, "intruder", "stranger", 365);
  Run(folder_,
      fmt::format("req -x509 {} -days 365 -subj /CN=self -addext subjectAltName=DNS:localhost,IP:127.0.0.1 -keyout self.key -out self.pem", kNewKey));
}

TestCertificates::~TestCertificates() {
  std::error_code ignored;
  std::filesystem::remove_all(folder_, ignored);
}

}  // namespace vorocast::support
