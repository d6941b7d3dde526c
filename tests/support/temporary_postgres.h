// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <sys/types.h>

#include <filesystem>
#include <memory>
#include <string>
#include <vector>

namespace vorocast::support {

/// A PostgreSQL server of a test's own, in a temporary folder and reached through a Unix socket in it only. Ends and is removed with this object.
/// As root it runs under another user, since PostgreSQL refuses root.
class TemporaryPostgres {
 public:
  /// `durable`: commits wait for the disk, as they would in use. Null when PostgreSQL is not installed. Crashes when it does not start.
  static std::unique_ptr<TemporaryPostgres> Start(bool durable = false);
  ~TemporaryPostgres();

  /// A URL for what nobody has used yet: each name is a schema of its own.
  std::string Url(const std::string& name) const;

  /// The whole server, at once.
  void Kill();
  /// After Kill; returns when it answers.
  void Restart();
  pid_t pid() const { return pid_; }

 private:
  explicit TemporaryPostgres(std::filesystem::path programs, bool durable);
  pid_t Launch(const std::string& program, const std::vector<std::string>& arguments) const;
  bool Answers() const;

  const std::filesystem::path programs_;
  const bool durable_;
  std::filesystem::path folder_;
  pid_t pid_ = -1;
};

}  // namespace vorocast::support
