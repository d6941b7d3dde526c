// SPDX-License-Identifier: AGPL-3.0-or-later
#include "services/client/job_view.h"

#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstdio>

#include <fmt/format.h>

#include "absl/time/clock.h"
#include "services/client/schedule_flags.h"

namespace vorocast::client {
namespace {

constexpr auto kLineInterval = std::chrono::seconds(2);
constexpr int kBarWidth = 24;

std::string Bar(double fraction) {
  const int full = std::clamp(static_cast<int>(std::lround(fraction * kBarWidth)), 0, kBarWidth);
  return std::string(static_cast<std::size_t>(full), '#') + std::string(static_cast<std::size_t>(kBarWidth - full), '.');
}

double Now() { return absl::ToDoubleSeconds(absl::Now() - absl::UnixEpoch()); }

std::string StateText(const v1::Job& job) {
  if (job.paused() && !HasEnded(job)) return "paused";
  switch (job.state()) {
    case v1::DONE:
      return "done";
    case v1::FAILED:
      return "failed";
    case v1::CANCELLED:
      return "cancelled";
    case v1::BLOCKED:
      return "waiting for frames";
    case v1::READY:
      return "waiting for a worker";
    default:
      return "running";
  }
}

std::string DescribeStage(const v1::Stage& stage) {
  std::string line = fmt::format("  {:<11} {} {:>5}/{:<5}", stage.kind(), Bar(stage.fraction()), stage.done(), stage.total());
  if (stage.seconds_mean() > 0) line += fmt::format(" {:>6.2f} s each", stage.seconds_mean());
  if (stage.reused() > 0) line += fmt::format("  {} reused", stage.reused());
  if (stage.running() > 0) line += fmt::format("  {} running", stage.running());
  if (stage.failed() > 0) line += fmt::format("  {} failed", stage.failed());
  if (stage.cancelled() > 0) line += fmt::format("  {} cancelled", stage.cancelled());
  return line + "\n";
}

}  // namespace

std::string FormatDuration(double seconds) {
  if (!(seconds >= 0)) return "–";
  const auto whole = static_cast<long long>(std::llround(seconds));
  if (whole >= 3600) return fmt::format("{}:{:02}:{:02}", whole / 3600, whole / 60 % 60, whole % 60);
  return fmt::format("{}:{:02}", whole / 60, whole % 60);
}

bool HasEnded(const v1::Job& job) { return job.state() == v1::DONE || job.state() == v1::FAILED || job.state() == v1::CANCELLED; }

std::string TakesOf(const v1::Job& job) {
  return job.onto_sequence_name().empty() ? job.sequence_name() : fmt::format("{} onto {}", job.sequence_name(), job.onto_sequence_name());
}

std::string DescribeJob(const v1::Job& job) {
  std::string text = fmt::format("{} ({}): {}", TakesOf(job), job.id(), StateText(job));
  if (!HasEnded(job) && job.seconds_left() >= 0) text += fmt::format(", about {} left", FormatDuration(job.seconds_left()));
  text += DescribeLateness(job, Now()) + "\n";
  for (const v1::Stage& stage : job.stages()) text += DescribeStage(stage);
  for (const v1::FailedTask& failure : job.failures())
    text += fmt::format("  failed: {}\n", failure.cause().starts_with(failure.label()) ? failure.cause() : failure.label() + ": " + failure.cause());
  return text;
}

std::string DescribeJobLine(const v1::Job& job) {
  std::string text;
  for (const v1::Stage& stage : job.stages()) {
    if (stage.done() == stage.total() && stage.reused() == stage.total()) continue;
    text += fmt::format("{}{} {}/{}", text.empty() ? "" : " · ", stage.kind(), stage.done(), stage.total());
  }
  if (text.empty() || HasEnded(job) || job.paused()) text = text.empty() ? StateText(job) : StateText(job) + ": " + text;
  if (!HasEnded(job) && job.seconds_left() >= 0) text += fmt::format(" · about {} left", FormatDuration(job.seconds_left()));
  return text + DescribeLateness(job, Now());
}

JobView::JobView() : terminal_(isatty(STDOUT_FILENO) == 1) {}

void JobView::Show(const v1::Job& job) {
  if (terminal_) {
    const std::string text = DescribeJob(job);
    if (text == last_text_) return;
    Erase();
    std::fputs(text.c_str(), stdout);
    lines_drawn_ = static_cast<int>(std::ranges::count(text, '\n'));
    last_text_ = text;
  } else {
    const auto now = std::chrono::steady_clock::now();
    if (now - last_line_ < kLineInterval) return;
    const std::string text = DescribeJobLine(job);
    if (text == last_text_) return;
    fmt::print("{}\n", text);
    last_line_ = now;
    last_text_ = text;
  }
  std::fflush(stdout);
}

void JobView::Finish(const v1::Job& job) {
  Erase();
  fmt::print("{}", DescribeJob(job));
  std::fflush(stdout);
}

void JobView::Say(const std::string& line) {
  Erase();
  last_text_.clear();
  fmt::print("{}\n", line);
  std::fflush(stdout);
}

void JobView::Erase() {
  if (lines_drawn_ > 0) fmt::print("\033[{}A\033[J", lines_drawn_);
  lines_drawn_ = 0;
}

}  // namespace vorocast::client
