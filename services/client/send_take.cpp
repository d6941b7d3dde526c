// SPDX-License-Identifier: AGPL-3.0-or-later
#include "services/client/send_take.h"

#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <optional>
#include <thread>

#include <fmt/format.h>

#include "services/capture/frame_reader.h"
#include "services/capture/growing_capture.h"
#include "services/client/interrupt.h"
#include "services/client/job_view.h"
#include "services/client/percent_view.h"
#include "services/client/run_job.h"
#include "services/client/through_breaks.h"

namespace vorocast::client {
namespace {

/// "412 frames sent, 3 being written": one line, redrawn on a terminal, every five seconds elsewhere.
class FollowView {
 public:
  void Show(std::size_t sent, std::size_t waiting) {
    const auto now = std::chrono::steady_clock::now();
    if (!terminal_ && now - last_ < std::chrono::seconds(5)) return;
    last_ = now;
    const std::string line = fmt::format("{} frames sent, {} being written", sent, waiting);
    if (line == said_) return;
    said_ = line;
    fmt::print("{}{}{}", terminal_ ? "\r" : "", line, terminal_ ? "   " : "\n");
    std::fflush(stdout);
  }
  void Say(const std::string& line) {
    fmt::print("{}{}\n", terminal_ ? "\r" : "", line);
    std::fflush(stdout);
    said_.clear();
  }

 private:
  bool terminal_ = isatty(STDOUT_FILENO) == 1;
  std::chrono::steady_clock::time_point last_{};
  std::string said_;
};

/// The folder's frames now; none when there is no frame yet.
absl::StatusOr<capture::Capture> Look(const std::filesystem::path& folder, const capture::CaptureOptions& options) {
  auto capture = capture::OpenCapture(folder, options);
  if (absl::IsNotFound(capture.status()) && std::filesystem::is_directory(folder)) return capture::Capture{};
  return capture;
}

/// One take that is being written.
class Follower {
 public:
  Follower(SchedulerClient& client, const std::filesystem::path& folder, const capture::CaptureOptions& options, const std::string& session,
           v1::SubmitJobRequest request, const FollowOptions& follow)
      : client_(client), folder_(folder), options_(options), session_(session), request_(std::move(request)), follow_(follow) {}

  absl::StatusOr<v1::Job> Run() {
    view_.Say(fmt::format("Following {}; it is over when {}{} appears in it", folder_.string(),
                          follow_.idle.count() > 0 ? fmt::format("nothing was written for {} s, or ", follow_.idle.count()) : "", kTakeIsOver));
    while (true) {
      if (Interrupted()) return StoppedByUser();
      // Asked first, so that what was written before it is seen below.
      const bool said_over = std::filesystem::exists(folder_ / kTakeIsOver);
      ASSIGN_OR_RETURN(const capture::Capture capture, Look(folder_, options_));
      const std::vector<capture::FrameFile> files = capture::FilesOf(capture);
      const auto now = std::chrono::steady_clock::now();
      ASSIGN_OR_RETURN(const std::vector<capture::CaptureFrame> whole, growing_.Next(files, now));
      for (const std::filesystem::path& path : growing_.ChangedLater(files)) {
        view_.Say(
            fmt::format("{}: changed after it was sent, so that frame may be incomplete; a longer --settle waits for slower writers", path.string()));
      }
      if (!whole.empty()) RETURN_IF_ERROR(Send(capture, whole));
      const std::size_t waiting = files.size() - growing_.left_count();
      view_.Show(growing_.left_count(), waiting);
      const bool quiet = follow_.idle.count() > 0 && now - growing_.last_change() > follow_.idle;
      if (waiting == 0 && (said_over || quiet)) return Close(said_over);
      std::this_thread::sleep_for(follow_.interval);
    }
  }

 private:
  template <typename Call>
  auto Through(const Call& call) {
    return ThroughBreaks(call, [this](const std::string& line) { view_.Say(line); });
  }

  absl::Status Send(const capture::Capture& capture, const std::vector<capture::CaptureFrame>& frames) {
    if (!job_) {
      if (const absl::Status status = CheckCapture(capture); !status.ok()) view_.Say(fmt::format("Warning: {}", std::string(status.message())));
      ASSIGN_OR_RETURN(const v1::Sequence sequence, Through([&] { return client_.OpenSequence(capture, session_); }));
      request_.set_sequence_id(sequence.id());
      ASSIGN_OR_RETURN(job_, Through([&] { return client_.Submit(request_); }));
      view_.Say(fmt::format("Job {}", job_->id()));
    }
    return Through([&] { return client_.SendFrames(request_.sequence_id(), frames, {}, Interrupted); }).status();
  }

  absl::StatusOr<v1::Job> Close(bool said_over) {
    if (!job_) {
      return absl::NotFoundError(fmt::format("{}: no frame was written into it{}", folder_.string(),
                                             said_over ? "" : fmt::format(" for {} s; --idle waits longer", follow_.idle.count())));
    }
    view_.Say(fmt::format("{}: the take is over with {} frames", said_over ? kTakeIsOver : "Nothing was written any more", growing_.left_count()));
    RETURN_IF_ERROR(Through([&] { return client_.CloseSequence(request_.sequence_id()); }).status());
    return Through([&] { return client_.Get(job_->id()); });
  }

  SchedulerClient& client_;
  const std::filesystem::path& folder_;
  const capture::CaptureOptions& options_;
  const std::string& session_;
  v1::SubmitJobRequest request_;
  const FollowOptions& follow_;
  FollowView view_;
  std::optional<v1::Job> job_;
  capture::GrowingCapture growing_{{.settle = follow_.settle}, [](const std::filesystem::path& path) { return capture::ReadRawFrame(path).ok(); }};
};

}  // namespace

absl::StatusOr<v1::Job> SendTake(SchedulerClient& client, const std::filesystem::path& folder, const capture::CaptureOptions& options,
                                 const std::string& session, v1::SubmitJobRequest request, const FollowOptions& follow) {
  if (follow.follow) return Follower(client, folder, options, session, std::move(request), follow).Run();

  ASSIGN_OR_RETURN(const capture::Capture capture, capture::OpenCapture(folder, options));
  RETURN_IF_ERROR(CheckCapture(capture));
  const auto say = [](const std::string& line) {
    fmt::print("{}\n", line);
    std::fflush(stdout);
  };
  PercentView view("Frames");
  const auto upload = [&] {
    return client.Upload(
        capture, session, [&](double fraction) { view.Show(fraction); }, Interrupted);
  };
  ASSIGN_OR_RETURN(const v1::Sequence sequence, ThroughBreaks(upload, say));
  view.Finish();
  request.set_sequence_id(sequence.id());
  ASSIGN_OR_RETURN(const v1::Job job, ThroughBreaks([&] { return client.Submit(request); }, say));
  fmt::print("Job {}\n", job.id());
  return job;
}

}  // namespace vorocast::client
