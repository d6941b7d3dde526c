// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <filesystem>
#include <memory>
#include <string>

#include "services/base/status.h"

namespace vorocast::client {

/// $XDG_CACHE_HOME/vorocast, or ~/.cache/vorocast: everything in it can be computed again.
std::filesystem::path DefaultStateFolder();

/// The address of the scheduler that serves a state folder. NOT_FOUND when none is running.
absl::StatusOr<std::string> RunningSchedulerAddress(const std::filesystem::path& state);

struct EmbeddedServiceOptions {
  std::filesystem::path state;
  std::int32_t workers = 0;  // 0: one a processor
};

/// A scheduler with its own workers and simulation on this machine, in one state folder, for as long as this object lives.
/// When another process serves the folder already, that one is used and left running.
class EmbeddedService {
 public:
  static absl::StatusOr<EmbeddedService> Start(const EmbeddedServiceOptions& options);
  EmbeddedService(EmbeddedService&&) noexcept;
  EmbeddedService& operator=(EmbeddedService&&) noexcept;
  /// Stops what Start started: the scheduler ends its workers, finished work stays.
  ~EmbeddedService();

  const std::string& address() const;
  /// False while another process's scheduler is used.
  bool started_here() const;
  /// Starts the scheduler again if it has died; does nothing while it runs. The address may change.
  absl::Status Ensure();

 private:
  struct Process;
  explicit EmbeddedService(std::unique_ptr<Process> process);
  std::unique_ptr<Process> process_;
};

}  // namespace vorocast::client
