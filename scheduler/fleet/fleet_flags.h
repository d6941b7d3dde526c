// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>

#include "scheduler/fleet/fleet.h"
#include "scheduler/fleet/sizing.h"
#include "services/base/status.h"

namespace vorocast::fleet {

/// Where a scheduler listens: for its own machine, which may have a door of its own, and for all others.
struct SchedulerAddresses {
  std::string here, elsewhere;
};

/// --workers, --simulation, --fleet, --slurm-… : which workers a scheduler keeps.
class FleetFlags {
 public:
  void AddTo(CLI::App& program);
  /// INVALID_ARGUMENT when they do not go together; `listen` is the scheduler's --listen.
  absl::Status Validate(const std::string& listen) const;
  /// The fleets asked for, perhaps none.
  absl::StatusOr<std::vector<std::unique_ptr<Fleet>>> Start(const std::filesystem::path& state, const SchedulerAddresses& addresses,
                                                            std::function<absl::StatusOr<Demand>()> demand) const;

 private:
  absl::StatusOr<std::unique_ptr<Fleet>> StartSlurm(const std::filesystem::path& state, const std::string& address,
                                                    std::function<absl::StatusOr<Demand>()> demand) const;

  std::string kind_ = "local";
  std::int32_t workers_ = 0;
  bool simulation_ = false;
  SizingLimits limits_{.workers_max = 64, .queued_max = 16};
  std::string partition_;
  std::string advertise_;
  std::string worker_;
  std::vector<std::string> extra_;
  std::vector<std::string> worker_extra_;
  double finish_in_s_ = 600;
  double poll_s_ = 5;
  double leave_after_s_ = 600;
  double drain_s_ = 20;
};

/// What workers on other machines connect to: `address` with this machine's name in the place of "any address".
std::string AddressForOthers(const std::string& address, const std::string& host);

}  // namespace vorocast::fleet
