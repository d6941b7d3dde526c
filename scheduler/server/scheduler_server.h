// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <filesystem>
#include <memory>
#include <string>

#include "services/base/status.h"

namespace vorocast::server {

struct SchedulerOptions {
  std::filesystem::path state;  // holds scheduler.db and the artifact folder
  std::string listen;           // host:port or unix:/path
};

/// A whole scheduler: its memory, its core and its three services. Goes on from what the state folder remembers.
class SchedulerServer {
 public:
  /// Errors: FAILED_PRECONDITION when another scheduler serves the folder, DATA_LOSS for a damaged database, UNAVAILABLE for an address
  /// that is taken.
  static absl::StatusOr<std::unique_ptr<SchedulerServer>> Start(const SchedulerOptions& options);
  /// Ends all calls, works off what has come in, and makes it durable. Workers keep what they hold.
  ~SchedulerServer();

  const std::string& address() const;

 private:
  struct Parts;
  explicit SchedulerServer(std::unique_ptr<Parts> parts);
  std::unique_ptr<Parts> parts_;
};

}  // namespace vorocast::server
