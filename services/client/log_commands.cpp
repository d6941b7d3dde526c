// SPDX-License-Identifier: AGPL-3.0-or-later
#include <cmath>
#include <memory>
#include <string>

#include <fmt/format.h>

#include "absl/time/time.h"
#include "services/client/attempt_view.h"
#include "services/client/commands.h"
#include "services/client/job_choice.h"

namespace vorocast::client {

void AddLogCommands(CLI::App& program, int& exit_code) {
  struct Flags {
    JobChoice choice;
    std::string task;
    bool failed = false;
  };
  auto flags = std::make_shared<Flags>();
  CLI::App& command = *program.add_subcommand("logs", "Show what became of each attempt at a job's tasks, and what it printed");
  flags->choice.AddTo(command);
  command.add_option("--task", flags->task, "Only this task, for example \"frame 12: tessellate\"");
  command.add_flag("--failed", flags->failed, "Only attempts that failed");
  command.footer("Attempts are kept for a while after their job has ended; 'vorocast serve --help' says how long.");
  command.callback([flags, &exit_code] {
    SetExitCode(exit_code, WithJob(flags->choice, [&](SchedulerClient& client, const std::string& job_id) -> absl::Status {
                  v1::AttemptsRequest request;
                  request.set_job_id(job_id);
                  request.set_task(flags->task);
                  request.set_logs(true);
                  std::int64_t shown = 0;
                  RETURN_IF_ERROR(client.Attempts(request, [&](const v1::TaskAttempt& attempt) {
                    if (flags->failed && attempt.outcome() != v1::FAILED) return;
                    ++shown;
                    fmt::print("{}", DescribeAttempt(attempt, absl::LocalTimeZone()));
                  }));
                  if (shown == 0) fmt::print("{}: no attempt of that kind is on record\n", job_id);
                  return absl::OkStatus();
                }));
  });
}

}  // namespace vorocast::client
