// SPDX-License-Identifier: AGPL-3.0-or-later
#include "services/client/job_choice.h"

#include <filesystem>
#include <vector>

#include <fmt/format.h>

#include "services/client/embedded_service.h"
#include "services/client/run_job.h"

namespace vorocast::client {

void SchedulerFlags::AddTo(CLI::App& command) {
  command.add_option("--to", to, "Scheduler's address, HOST:PORT; A,B where one stands by (VOROCAST_SCHEDULER, or the one serving --state here)")
      ->envname("VOROCAST_SCHEDULER");
  command.add_option("--state", state, "State folder of a scheduler on this machine (~/.cache/vorocast)");
  security.AddTo(command);
}

absl::StatusOr<SchedulerClient> SchedulerFlags::Connect() const {
  if (!to.empty()) return SchedulerClient::Open(to, security.Get());
  ASSIGN_OR_RETURN(const std::string address, RunningSchedulerAddress(state.empty() ? DefaultStateFolder() : std::filesystem::path(state)));
  return SchedulerClient::Open(address, security.Get());
}

void JobChoice::AddTo(CLI::App& command) {
  command.add_option("job", job_id, "Job id as 'vorocast status' lists it (the newest)");
  scheduler.AddTo(command);
}

absl::Status WithJob(const JobChoice& choice, const JobAction& action) {
  ASSIGN_OR_RETURN(SchedulerClient client, choice.scheduler.Connect());
  if (!choice.job_id.empty()) return action(client, choice.job_id);
  ASSIGN_OR_RETURN(const std::vector<v1::Job> jobs, client.List(1));
  if (jobs.empty()) return absl::NotFoundError(fmt::format("the scheduler at {} has no jobs; 'vorocast submit' makes one", client.address()));
  return action(client, jobs.front().id());
}

void SetExitCode(int& exit_code, const absl::Status& status) { exit_code = status.ok() ? 0 : PrintError(status); }

}  // namespace vorocast::client
