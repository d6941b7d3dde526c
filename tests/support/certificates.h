// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <filesystem>
#include <string>

namespace vorocast::support {

/// Certificates of a test's own, made by the openssl program as docs/operations.md has its readers make theirs. Removed with this object.
class TestCertificates {
 public:
  /// Crashes when openssl is not installed.
  TestCertificates();
  ~TestCertificates();
  TestCertificates(const TestCertificates&) = delete;
  TestCertificates& operator=(const TestCertificates&) = delete;

  /// "ca", "stranger": authorities. "server": of the first for localhost, 127.0.0.1 and this host's name. "expired": the same, but over. "client": of
  /// the first. "intruder": a client of the second. "self": signed by itself.
  std::string Certificate(const std::string& name) const { return (folder_ / (name + ".pem")).string(); }
  std::string Key(const std::string& name) const { return (folder_ / (name + ".key")).string(); }
  const std::filesystem::path& folder() const { return folder_; }

 private:
  std::filesystem::path folder_;
};

}  // namespace vorocast::support
