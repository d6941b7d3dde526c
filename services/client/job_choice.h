// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <functional>
#include <string>

#include <CLI/CLI.hpp>

#include "services/base/status.h"
#include "services/client/scheduler_client.h"
#include "services/rpc/security_flags.h"

/// The flags by which a command finds its scheduler and its job.
namespace vorocast::client {

/// Which scheduler is meant: --to, else $VOROCAST_SCHEDULER, else the one that serves --state on this machine.
struct SchedulerFlags {
  std::string to, state;
  rpc::ClientSecurityFlags security;

  void AddTo(CLI::App& command);
  absl::StatusOr<SchedulerClient> Connect() const;
};

/// A job command's flags: the scheduler and a job, by default the newest.
struct JobChoice {
  SchedulerFlags scheduler;
  std::string job_id;

  void AddTo(CLI::App& command);
};

using JobAction = std::function<absl::Status(SchedulerClient&, const std::string& job_id)>;

absl::Status WithJob(const JobChoice& choice, const JobAction& action);

/// Says an error to the user.
void SetExitCode(int& exit_code, const absl::Status& status);

}  // namespace vorocast::client
