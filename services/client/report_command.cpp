// SPDX-License-Identifier: AGPL-3.0-or-later
#include <charconv>
#include <fstream>
#include <memory>
#include <string>
#include <string_view>

#include <fmt/format.h>

#include "absl/time/clock.h"
#include "services/client/commands.h"
#include "services/client/job_choice.h"
#include "services/client/percent_view.h"
#include "services/report/frame_picture.h"
#include "services/report/session_report.h"

namespace vorocast::client {
namespace {

constexpr std::int32_t kJobsMax = 1000;
constexpr std::int64_t kFrameBytesMax = std::int64_t{256} << 20;
/// Pages with thousands of pictures help nobody.
constexpr std::size_t kPicturesInAll = 100;

/// The number in "frame 412: tessellate"; negative for another task.
std::int32_t FrameOf(std::string_view task) {
  constexpr std::string_view kFrame = "frame ";
  if (!task.starts_with(kFrame) || !task.ends_with(": tessellate")) return -1;
  std::int32_t frame = -1;
  std::from_chars(task.data() + kFrame.size(), task.data() + task.size(), frame);
  return frame;
}

/// The format is not known: the name that exists is the right one.
report::FramePicture DrawFrame(SchedulerClient& client, const std::string& job, const std::string& task) {
  report::FramePicture picture{.task = task};
  absl::Status why;
  for (const char* extension : {".ply", ".drc", ".obj", ".off"}) {
    const auto bytes = client.FetchBytes(job, fmt::format("capture/frame_{:06}{}", FrameOf(task), extension), kFrameBytesMax);
    if (bytes.ok()) {
      auto png = report::DrawFrame(*bytes, extension);
      why = png.status();
      if (png.ok()) picture.png = *std::move(png);
      break;
    }
    if (why.ok() || !absl::IsNotFound(bytes.status())) why = bytes.status();
    if (!absl::IsNotFound(bytes.status())) break;
  }
  picture.why_not = std::string(why.message());
  return picture;
}

absl::StatusOr<report::JobReport> ReportJob(SchedulerClient& client, const v1::Job& job, double now, std::size_t pictures_left,
                                            report::Timeline& timeline) {
  report::JobReport shown{.job = job};
  v1::AttemptsRequest request;
  request.set_job_id(job.id());
  request.set_logs(true);
  const absl::Status attempts = client.Attempts(request, [&](const v1::TaskAttempt& attempt) {
    shown.attempts.Add(attempt);
    timeline.Add(attempt, now);
  });
  if (absl::IsUnavailable(attempts)) return attempts;
  if (!attempts.ok()) shown.attempts_missing = std::string(attempts.message());
  for (const v1::FailedTask& failure : job.failures()) {
    if (shown.pictures.size() >= std::min(report::kPicturesMax, pictures_left)) break;
    if (FrameOf(failure.label()) >= 0) shown.pictures.push_back(DrawFrame(client, job.id(), failure.label()));
  }
  return shown;
}

absl::Status Write(const std::string& path, const std::string& html) {
  std::ofstream file(path, std::ios::binary | std::ios::trunc);
  file << html;
  file.close();
  if (file.fail()) return absl::UnavailableError(fmt::format("{}: cannot be written; choose another place with -o", path));
  return absl::OkStatus();
}

absl::Status Report(const SchedulerFlags& scheduler, const std::string& session, const std::string& path) {
  ASSIGN_OR_RETURN(SchedulerClient client, scheduler.Connect());
  ASSIGN_OR_RETURN(const v1::ListJobsReply list, client.ListAll(kJobsMax, session));
  if (list.jobs().empty()) {
    return absl::NotFoundError(
        fmt::format("the scheduler at {} has no job of a session \"{}\"; 'vorocast submit' sets it with --session", client.address(), session));
  }
  const double now = absl::ToDoubleSeconds(absl::Now() - absl::UnixEpoch());
  report::SessionReport whole{.session = session, .scheduler = client.address(), .version = VOROCAST_VERSION, .made = now, .fleet = list.fleet()};
  PercentView view("Jobs");
  std::size_t pictures = 0;
  for (const v1::Job& job : list.jobs()) {
    ASSIGN_OR_RETURN(report::JobReport shown, ReportJob(client, job, now, kPicturesInAll - std::min(pictures, kPicturesInAll), whole.timeline));
    pictures += shown.pictures.size();
    whole.jobs.push_back(std::move(shown));
    view.Show(static_cast<double>(whole.jobs.size()) / list.jobs_size());
  }
  view.Finish();
  RETURN_IF_ERROR(Write(path, report::ToHtml(whole)));
  fmt::print("{}: {} jobs\n", path, whole.jobs.size());
  return absl::OkStatus();
}

}  // namespace

void AddReportCommand(CLI::App& program, int& exit_code) {
  struct Flags {
    SchedulerFlags scheduler;
    std::string session, out = "report.html";
  };
  auto flags = std::make_shared<Flags>();
  CLI::App& command = *program.add_subcommand("report", "Write one HTML page on a session: what finished, what failed and why, where the time went");
  command.add_option("session", flags->session, "Recording day, as it was given to 'vorocast submit --session'")->required();
  command.add_option("-o,--out", flags->out, "The page")->capture_default_str();
  flags->scheduler.AddTo(command);
  command.callback([flags, &exit_code] { SetExitCode(exit_code, Report(flags->scheduler, flags->session, flags->out)); });
}

}  // namespace vorocast::client
