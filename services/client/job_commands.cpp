// SPDX-License-Identifier: AGPL-3.0-or-later
#include <algorithm>
#include <cstdlib>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <fmt/format.h>

#include "services/client/commands.h"
#include "services/client/embedded_service.h"
#include "services/client/fleet_view.h"
#include "services/client/interrupt.h"
#include "services/client/job_choice.h"
#include "services/client/job_flags.h"
#include "services/client/job_view.h"
#include "services/client/percent_view.h"
#include "services/client/run_job.h"
#include "services/client/send_take.h"
#include "services/client/through_breaks.h"

namespace vorocast::client {
namespace {

/// Shows the job until it has ended; an error unless it is done then.
absl::Status FollowToItsEnd(SchedulerClient& client, const std::string& job_id) {
  JobView view;
  const auto watch = [&] {
    return client.Watch(
        job_id, [&](const v1::Job& now) { view.Show(now); }, Interrupted);
  };
  ASSIGN_OR_RETURN(const v1::Job job, ThroughBreaks(watch, [&](const std::string& line) { view.Say(line); }));
  view.Finish(job);
  if (job.state() == v1::DONE) return absl::OkStatus();
  return absl::AbortedError(fmt::format("job {} is not done; 'vorocast explain {}' says why", job_id, job_id));
}

/// A command that does one thing with one job.
CLI::App& AddJobCommand(CLI::App& program, int& exit_code, const std::string& name, const std::string& description, const JobAction& action) {
  auto choice = std::make_shared<JobChoice>();
  CLI::App& command = *program.add_subcommand(name, description);
  choice->AddTo(command);
  command.callback([choice, action, &exit_code] { SetExitCode(exit_code, WithJob(*choice, action)); });
  return command;
}

void AddSubmit(CLI::App& program, int& exit_code) {
  struct Flags {
    std::string folder, session = "default";
    CaptureFlags capture;
    OntoFlags onto;
    JobFlags job;
    SchedulerFlags scheduler;
    FollowOptions follow;
    bool watch = false;
  };
  auto flags = std::make_shared<Flags>();
  CLI::App& command = *program.add_subcommand("submit", "Send a capture to a running scheduler and ask for a job on it");
  command.add_option("capture", flags->folder, "Folder with one file a frame: PLY, OBJ, OFF or Draco")->required();
  command.add_option("--session", flags->session, "Recording day the take belongs to")->capture_default_str();
  flags->capture.AddTo(command);
  flags->onto.AddTo(command);
  flags->job.AddTo(command);
  flags->scheduler.AddTo(command);
  command.add_flag("--watch", flags->watch, "Stay and show the job as it goes on");
  command.add_flag("--follow", flags->follow.follow, "Send the frames while the capture writes them; they are worked on as they arrive");
  command
      .add_option("--idle", flags->follow.idle,
                  "With --follow: seconds without a write after which the take is over; 0: only capture.done ends it (60)")
      ->check(CLI::Range(0, 86400));
  command.add_option("--settle", flags->follow.settle, "With --follow: milliseconds without a write after which a file is whole (1000)")
      ->check(CLI::Range(10, 600000));
  command.footer(
      "What the scheduler has already is not sent again: after a break, the same command goes on.\n"
      "Frames get their numbers by the order of their file names. A scheduler that is away is waited for.\n"
      "Example: vorocast submit /capture/take7 --to farm:7400 --session 2026-05-02 --units mm --effect melt --follow");
  command.callback([flags, &exit_code] {
    const auto submit = [&]() -> absl::Status {
      ASSIGN_OR_RETURN(const capture::CaptureOptions options, flags->capture.Parse());
      ASSIGN_OR_RETURN(v1::SubmitJobRequest request, flags->job.Parse());
      ASSIGN_OR_RETURN(const std::optional<capture::Capture> onto, flags->onto.Open(request));
      if (onto) RETURN_IF_ERROR(CheckCapture(*onto));
      ASSIGN_OR_RETURN(SchedulerClient client, flags->scheduler.Connect());
      CatchInterrupts();
      if (onto) {
        PercentView view("Frames of the second take");
        ASSIGN_OR_RETURN(const v1::Sequence second, client.Upload(
                                                        *onto, flags->session, [&](double fraction) { view.Show(fraction); }, Interrupted));
        view.Finish();
        request.set_onto_sequence_id(second.id());
      }
      ASSIGN_OR_RETURN(const v1::Job job, SendTake(client, flags->folder, options, flags->session, request, flags->follow));
      if (!flags->watch) return absl::OkStatus();
      return FollowToItsEnd(client, job.id());
    };
    SetExitCode(exit_code, submit());
  });
}

void AddStatus(CLI::App& program, int& exit_code) {
  auto choice = std::make_shared<JobChoice>();
  CLI::App& command = *program.add_subcommand("status", "List the jobs, or show one in full");
  choice->AddTo(command);
  command.callback([choice, &exit_code] {
    const auto status = [&]() -> absl::Status {
      ASSIGN_OR_RETURN(SchedulerClient client, choice->scheduler.Connect());
      if (!choice->job_id.empty()) {
        ASSIGN_OR_RETURN(const v1::Job job, client.Get(choice->job_id));
        fmt::print("{}", DescribeJob(job));
        return absl::OkStatus();
      }
      ASSIGN_OR_RETURN(const v1::ListJobsReply list, client.ListAll(50, ""));
      fmt::print("{}", DescribeFleet(list.fleet(), absl::LocalTimeZone()));
      if (list.jobs().empty()) fmt::print("No jobs\n");
      for (const v1::Job& job : list.jobs()) fmt::print("{}  {:<24} {:<12} {}\n", job.id(), TakesOf(job), job.user(), DescribeJobLine(job));
      return absl::OkStatus();
    };
    SetExitCode(exit_code, status());
  });
}

void AddExplain(CLI::App& program, int& exit_code) {
  auto choice = std::make_shared<JobChoice>();
  auto task = std::make_shared<std::string>();
  CLI::App& command = *program.add_subcommand("explain", "Say in one sentence why a job or a task waits or failed");
  choice->AddTo(command);
  command.add_option("--task", *task, "A task's name, for example \"frame 12: tessellate\"");
  command.callback([choice, task, &exit_code] {
    SetExitCode(exit_code, WithJob(*choice, [&](SchedulerClient& client, const std::string& job_id) -> absl::Status {
                  ASSIGN_OR_RETURN(const std::string text, client.Explain(job_id, *task));
                  fmt::print("{}\n", text);
                  return absl::OkStatus();
                }));
  });
}

void AddFetch(CLI::App& program, int& exit_code) {
  auto choice = std::make_shared<JobChoice>();
  auto out = std::make_shared<std::string>();
  CLI::App& command = *program.add_subcommand("fetch", "Copy a job's results into a folder");
  choice->AddTo(command);
  command.add_option("--out", *out, "Folder for the results (vorocast-out/JOB)");
  command.callback([choice, out, &exit_code] {
    SetExitCode(exit_code, WithJob(*choice, [&](SchedulerClient& client, const std::string& job_id) -> absl::Status {
                  CatchInterrupts();
                  ASSIGN_OR_RETURN(const v1::Job job, client.Get(job_id));
                  const std::filesystem::path folder = out->empty() ? std::filesystem::path("vorocast-out") / job_id : std::filesystem::path(*out);
                  RETURN_IF_ERROR(FetchOutputs(client, job, folder));
                  fmt::print("{} files in {}\n", job.outputs_size(), folder.string());
                  return absl::OkStatus();
                }));
  });
}

void AddRetry(CLI::App& program, int& exit_code) {
  auto limits = std::make_shared<LimitFlags>();
  const JobAction retry = [limits](SchedulerClient& client, const std::string& job_id) -> absl::Status {
    v1::RetryJobRequest request;
    request.set_job_id(job_id);
    request.set_time_factor(limits->time_factor);
    ASSIGN_OR_RETURN(const std::int64_t memory, limits->MemoryLimit());
    request.set_memory_limit(memory);
    ASSIGN_OR_RETURN(const v1::Job job, client.Retry(request));
    fmt::print("{}", DescribeJob(job));
    return absl::OkStatus();
  };
  limits->AddTo(AddJobCommand(program, exit_code, "retry", "Try a job's failed and cancelled tasks again, under other limits if need be", retry));
}

}  // namespace

void AddJobCommands(CLI::App& program, int& exit_code) {
  AddSubmit(program, exit_code);
  AddStatus(program, exit_code);
  AddJobCommand(program, exit_code, "watch", "Show a job as it goes on, until it has ended", [](SchedulerClient& client, const std::string& job_id) {
    CatchInterrupts();
    return FollowToItsEnd(client, job_id);
  });
  AddExplain(program, exit_code);
  AddJobCommand(program, exit_code, "cancel", "Stop a job; what has finished stays",
                [](SchedulerClient& client, const std::string& job_id) -> absl::Status {
                  ASSIGN_OR_RETURN(const v1::Job job, client.Cancel(job_id));
                  fmt::print("{}", DescribeJob(job));
                  return absl::OkStatus();
                });
  AddJobCommand(program, exit_code, "pause", "Start nothing further of a job; what runs goes on to its end",
                [](SchedulerClient& client, const std::string& job_id) -> absl::Status {
                  ASSIGN_OR_RETURN(const v1::Job job, client.Pause(job_id));
                  fmt::print("{}", DescribeJob(job));
                  return absl::OkStatus();
                });
  AddJobCommand(program, exit_code, "resume", "Let a paused job go on", [](SchedulerClient& client, const std::string& job_id) -> absl::Status {
    ASSIGN_OR_RETURN(const v1::Job job, client.Resume(job_id));
    fmt::print("{}", DescribeJob(job));
    return absl::OkStatus();
  });
  AddRetry(program, exit_code);
  AddFetch(program, exit_code);
}

}  // namespace vorocast::client
