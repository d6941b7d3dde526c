// SPDX-License-Identifier: AGPL-3.0-or-later
#include "services/client/run_job.h"

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <thread>

#include <fmt/format.h>

#include "services/base/digest.h"
#include "services/capture/frame_reader.h"
#include "services/client/embedded_service.h"
#include "services/client/interrupt.h"
#include "services/client/job_view.h"
#include "services/client/percent_view.h"
#include "services/storage/xdmf.h"

namespace vorocast::client {
namespace {

/// So many times in a row the scheduler may be unreachable before the client gives up.
constexpr int kReconnectsMax = 20;
constexpr std::int32_t kAbandonedJobsMax = 200;
constexpr auto kFullDiskPause = std::chrono::seconds(1);
constexpr auto kReconnectPause = std::chrono::milliseconds(250);

/// Runs share one state folder, and the same folder of frames may be run with other flags or in part; each gets a sequence of its own.
std::string SessionOf(const capture::Capture& capture) {
  base::Hasher hasher;
  hasher.UpdateField(fmt::format("{} {} {}", capture.frames_per_second, capture.metres_per_unit, capture.up));
  for (const capture::CaptureFrame& frame : capture.frames) {
    std::error_code error;
    const auto size = std::filesystem::file_size(frame.path, error);
    const auto time = std::filesystem::last_write_time(frame.path, error).time_since_epoch().count();
    hasher.UpdateField(fmt::format("{} {} {} {}", std::filesystem::absolute(frame.path).string(), frame.number, error ? 0 : size, time));
  }
  return "run-" + hasher.Finish().Short();
}

absl::Status InterruptedStatus() { return absl::CancelledError("stopped; the same command goes on from here"); }

/// A client that was killed could not cancel its job. Only the client that starts the scheduler calls this, before it submits its own: what
/// was left behind would be computed first otherwise. Its finished results stay.
absl::Status CancelAbandonedJobs(SchedulerClient& client) {
  ASSIGN_OR_RETURN(const std::vector<v1::Job> jobs, client.List(kAbandonedJobsMax));
  for (const v1::Job& job : jobs) {
    if (!HasEnded(job)) RETURN_IF_ERROR(client.Cancel(job.id()).status());
  }
  return absl::OkStatus();
}

/// Submits the job and follows it to its end; when the scheduler dies on the way, starts it again and goes on.
absl::StatusOr<v1::Job> FollowJob(EmbeddedService& service, std::unique_ptr<SchedulerClient>& client, const v1::SubmitJobRequest& request) {
  JobView view;
  std::string job_id;
  std::string said;
  int reconnects = 0;
  while (true) {
    absl::StatusOr<v1::Job> job = job_id.empty() ? client->Submit(request) : client->Get(job_id);
    if (job.ok()) {
      job_id = job->id();
      job = client->Watch(
          job_id,
          [&](const v1::Job& now) {
            reconnects = 0;
            view.Show(now);
          },
          Interrupted);
    }
    if (Interrupted()) {
      if (!job_id.empty()) (void)client->Cancel(job_id);
      return InterruptedStatus();
    }
    if (job.ok() && HasEnded(*job)) {
      view.Finish(*job);
      return job;
    }
    if (absl::IsResourceExhausted(job.status())) {
      // Its disk is full: it goes on by itself once there is room, and so does this.
      if (std::string why(job.status().message()); why != said) view.Say(said = std::move(why));
      reconnects = 0;
      std::this_thread::sleep_for(kFullDiskPause);
      continue;
    }
    if (!job.ok() && !absl::IsUnavailable(job.status()) && !absl::IsDeadlineExceeded(job.status())) return job.status();
    if (++reconnects > kReconnectsMax) return job.ok() ? absl::UnavailableError("the scheduler ended the stream again and again") : job.status();
    if (reconnects == 1) view.Say("The scheduler is away; starting it again. Nothing finished is lost.");
    std::this_thread::sleep_for(kReconnectPause);
    RETURN_IF_ERROR(service.Ensure());
    client = std::make_unique<SchedulerClient>(service.address());
  }
}

absl::StatusOr<v1::Sequence> UploadTake(SchedulerClient& client, const capture::Capture& capture, const std::string& title) {
  PercentView view(title);
  ASSIGN_OR_RETURN(v1::Sequence sequence, client.Upload(
                                              capture, SessionOf(capture), [&](double fraction) { view.Show(fraction); }, Interrupted));
  view.Finish();
  return sequence;
}

/// XDMF beside the takes, for ParaView.
absl::Status WriteXdmfBeside(const std::filesystem::path& folder) {
  const std::filesystem::path tracked = folder / "tracked.h5";
  const std::filesystem::path simulated = folder / "simulated.h5";
  if (std::filesystem::exists(tracked)) RETURN_IF_ERROR(storage::WriteXdmf(tracked, "", folder / "tracked.xdmf"));
  if (std::filesystem::exists(tracked) && std::filesystem::exists(simulated))
    RETURN_IF_ERROR(storage::WriteXdmf(simulated, tracked, folder / "simulated.xdmf"));
  return absl::OkStatus();
}

void PrintResults(const v1::Job& job, const std::filesystem::path& out, double seconds) {
  fmt::print("\n{} after {}. Results in {}:\n", job.state() == v1::DONE ? "Done" : "Ended", FormatDuration(seconds), out.string());
  // One line for what is one file a frame.
  const auto in_folder = [](const std::string& folder) { return [folder](const v1::Output& output) { return output.name().starts_with(folder); }; };
  for (const v1::Output& output : job.outputs()) {
    if (in_folder("cells/")(output) || in_folder("film/")(output) || in_folder("onto/cells/")(output)) continue;
    fmt::print("  {:<24} {:>8.1f} MB\n", output.name(), static_cast<double>(output.size()) / 1e6);
  }
  for (const std::string folder : {"cells/", "film/", "onto/cells/"}) {
    if (const auto count = std::ranges::count_if(job.outputs(), in_folder(folder)); count > 0) fmt::print("  {:<24} {} files\n", folder, count);
  }
}

}  // namespace

int PrintError(const absl::Status& status) {
  fmt::print(stderr, "vorocast: error: {}\n", std::string(status.message()));
  return absl::IsInvalidArgument(status) || absl::IsNotFound(status) || absl::IsAlreadyExists(status) ? 2 : 1;
}

absl::Status CheckCapture(const capture::Capture& capture) {
  capture::FrameReadOptions options;
  options.metres_per_unit = capture.metres_per_unit;
  options.up = capture.up;
  absl::Status first_error;
  for (const std::size_t i : {std::size_t{0}, capture.frames.size() / 2, capture.frames.size() - 1}) {
    const auto frame = capture::ReadFrame(capture.frames[i].path, options);
    if (frame.ok()) {
      geometry::Box3 box;
      for (const auto& p : frame->points.positions) box.extend(p);
      fmt::print("{}: {} frames at {:g} a second, {:.2f} m tall{}\n", capture.name, capture.frames.size(), capture.frames_per_second, box.sizes().y(),
                 frame->notes.normals_estimated ? ", normals estimated" : "");
      return absl::OkStatus();
    }
    if (first_error.ok()) first_error = frame.status();
  }
  return first_error;
}

absl::Status FetchOutputs(SchedulerClient& client, const v1::Job& job, const std::filesystem::path& folder) {
  PercentView view("Results");
  double total = 1, fetched = 0;
  for (const v1::Output& output : job.outputs()) total += static_cast<double>(output.size());
  for (const v1::Output& output : job.outputs()) {
    if (Interrupted()) return InterruptedStatus();
    RETURN_IF_ERROR(client.Fetch(job.id(), output, folder / output.name()));
    view.Show((fetched += static_cast<double>(output.size())) / total);
  }
  return WriteXdmfBeside(folder);
}

int RunJob(const capture::Capture& capture, const capture::Capture* onto, v1::SubmitJobRequest request, const RunOptions& options) {
  const auto started = std::chrono::steady_clock::now();
  if (const absl::Status status = CheckCapture(capture); !status.ok()) return PrintError(status);
  if (onto != nullptr) {
    if (const absl::Status status = CheckCapture(*onto); !status.ok()) return PrintError(status);
  }
  CatchInterrupts();

  fmt::print("State folder: {}\n", options.state.string());
  auto service = EmbeddedService::Start({options.state, options.workers});
  if (!service.ok()) return PrintError(service.status());
  auto client = std::make_unique<SchedulerClient>(service->address());
  if (service->started_here()) {
    if (const absl::Status status = CancelAbandonedJobs(*client); !status.ok()) return PrintError(status);
  }

  const auto sequence = UploadTake(*client, capture, "Frames");
  if (!sequence.ok()) return PrintError(sequence.status());
  request.set_sequence_id(sequence->id());
  if (onto != nullptr) {
    const auto second = UploadTake(*client, *onto, "Frames of the second take");
    if (!second.ok()) return PrintError(second.status());
    request.set_onto_sequence_id(second->id());
  }
  const auto job = FollowJob(*service, client, request);
  if (!job.ok()) return PrintError(job.status());

  const absl::Status fetched = FetchOutputs(*client, *job, options.out);
  if (!fetched.ok()) return PrintError(fetched);
  PrintResults(*job, std::filesystem::absolute(options.out).lexically_normal(),
               std::chrono::duration<double>(std::chrono::steady_clock::now() - started).count());
  return job->state() == v1::DONE ? 0 : 1;
}

}  // namespace vorocast::client
