// SPDX-License-Identifier: AGPL-3.0-or-later
// How a long take speeds up with the number of workers: the scheduler's plan and core as they are, in simulated time, with task times as measured.
// Usage: bench_scaling [--frames N] [--picture OUT.png] [--json FILE]. Explained in docs/scaling.md.
#include <algorithm>
#include <array>
#include <cmath>
#include <string>
#include <vector>

#include <fmt/format.h>

#include "services/rendering/sheet.h"
#include "services/rendering/stroke_font.h"
#include "tests/bench/bench_report.h"
#include "tests/scenario/clocked_farm.h"

namespace vorocast::bench {
namespace {

using geometry::Rgb8;
using rendering::Image;
using scenario::FarmRun;
using scenario::FarmTimes;

constexpr std::array<std::int32_t, 5> kWorkers = {1, 4, 16, 64, 256};
constexpr std::int32_t kFrames = 2800;  // the paper's BirdCageDance
constexpr double kGoalEfficiency = 0.8;

/// CPU seconds of the child processes, measured as docs/scaling.md says. The spread covers other frames of the same take.
FarmTimes Measured() {
  FarmTimes times;
  const auto set = [&](tasks::Kind kind, const scenario::TaskTime& time) { times.of[static_cast<std::size_t>(kind)] = time; };
  set(tasks::Kind::kTessellate, {.start_s = 0.80, .spread = 0.10});
  set(tasks::Kind::kTemplate, {.start_s = 1.9, .per_input_s = 0.001, .spread = 0.10});
  set(tasks::Kind::kStretch, {.start_s = 0.10, .per_input_s = 0.092, .spread = 0.10});
  set(tasks::Kind::kGuide, {.start_s = 0.10, .per_input_s = 0.012, .spread = 0.10});
  set(tasks::Kind::kTrack, {.start_s = 0.10, .per_input_s = 0.091, .spread = 0.10});
  set(tasks::Kind::kAssemble, {.start_s = 0.05, .per_input_s = 0.0135, .spread = 0.05});
  return times;
}

class Chart {
 public:
  Chart() { image_.rgb.assign(3 * static_cast<std::size_t>(image_.width) * static_cast<std::size_t>(image_.height), 255); }

  void Axes() {
    for (const std::int32_t n : kWorkers) {
      Line(n, 1, n, 256, kFaint, 1);
      Line(1, n, 256, n, kFaint, 1);
      Text(X(n) - rendering::TextWidth(std::to_string(n), 10) / 2, Y(1) + 12, std::to_string(n), 10);
      Text(X(1) - 14 - rendering::TextWidth(std::to_string(n), 10), Y(n) - 5, std::to_string(n), 10);
    }
    Line(1, 1, 256, 1, kInk, 1);
    Line(1, 1, 1, 256, kInk, 1);
    Text(X(16) - rendering::TextWidth("workers", 11) / 2, Y(1) + 38, "workers", 11);
    Text(24, 52, "times as fast as one worker", 11);
  }
  void Title(const std::string& title) { Text(24, 22, title, 14); }
  void Line(double x0, double y0, double x1, double y1, const Rgb8& colour, double width) {
    const double steps = 2 * std::max(std::abs(X(x1) - X(x0)), std::abs(Y(y1) - Y(y0))) + 1;
    for (double t = 0; t <= 1; t += 1 / steps) {
      Dot(X(x0) + t * (X(x1) - X(x0)), Y(y0) + t * (Y(y1) - Y(y0)), width / 2, colour);
    }
  }
  void Mark(double x, double y, const std::string& label, const Rgb8& colour) {
    Dot(X(x), Y(y), 6, colour);
    Text(X(x) + 12, Y(y) + 6, label, 9);
  }
  void Legend(double top, const std::string& text, const Rgb8& colour) {
    Dot(X(1) + 24, top + 5, 6, colour);
    Text(X(1) + 40, top, text, 10);
  }
  const Image& image() const { return image_; }

  static constexpr Rgb8 kInk = {40, 44, 52};
  static constexpr Rgb8 kFaint = {225, 228, 232};

 private:
  double X(double workers) const { return 80 + (image_.width - 160) * std::log2(workers) / 8; }
  double Y(double speed_up) const { return image_.height - 80 - (image_.height - 170) * std::log2(speed_up) / 8; }
  void Text(double left, double top, const std::string& text, double cap_height) {
    rendering::DrawText(image_, left, top, text, {.cap_height = cap_height, .colour = kInk});
  }
  void Dot(double x, double y, double radius, const Rgb8& colour) {
    const double reach = std::max(radius, 0.5);
    for (auto row = static_cast<std::int32_t>(std::ceil(y - reach)); row <= y + reach; ++row) {
      for (auto column = static_cast<std::int32_t>(std::ceil(x - reach)); column <= x + reach; ++column) {
        if (row < 0 || row >= image_.height || column < 0 || column >= image_.width) continue;
        if (std::hypot(column - x, row - y) > reach) continue;
        std::ranges::copy(colour, image_.rgb.begin() + 3 * (static_cast<std::ptrdiff_t>(row) * image_.width + column));
      }
    }
  }

  Image image_{900, 700, {}};
};

absl::Status DrawCurve(const std::string& path, std::int32_t frames, const std::vector<double>& speed_up) {
  constexpr Rgb8 kMeasured = {58, 124, 189};
  constexpr Rgb8 kGoal = {230, 145, 56};
  Chart chart;
  chart.Title(fmt::format("A take of {} frames, 5000 cells, to tracked.h5", frames));
  chart.Axes();
  chart.Line(1, 1, 256, 256, {150, 156, 166}, 2);
  chart.Line(1 / kGoalEfficiency, 1, 256, 256 * kGoalEfficiency, kGoal, 2);
  for (std::size_t i = 0; i < speed_up.size(); ++i) {
    if (i > 0) chart.Line(kWorkers[i - 1], speed_up[i - 1], kWorkers[i], speed_up[i], kMeasured, 3);
    chart.Mark(kWorkers[i], speed_up[i], fmt::format("{:.1f}", speed_up[i]), kMeasured);
  }
  chart.Legend(110, "plan and scheduler, simulated clock", kMeasured);
  chart.Legend(134, "linear", {150, 156, 166});
  chart.Legend(158, fmt::format("{:.1f} of linear", kGoalEfficiency), kGoal);
  return rendering::WritePng(path, chart.image());
}

absl::Status Run(BenchReport& report, std::int32_t frames, const std::string& picture) {
  const FarmTimes times = Measured();
  plan::JobSpec job;
  job.sheets = false;
  std::vector<double> speed_up;
  double one_s = 0;
  BenchCase bench_case{.name = fmt::format("scaling-{}", frames), .goal = {{"min_efficiency_64", kGoalEfficiency}}};
  fmt::print(
      "| workers | wall s | of linear | cells until | stretches until | guide at | windows until | assembled |\n|---|---|---|---|---|---|---|---|\n");
  const double cpu_before = CpuSeconds();
  for (const std::int32_t workers : kWorkers) {
    ASSIGN_OR_RETURN(const FarmRun run, scenario::RunClockedFarm(job, frames, workers, times));
    if (workers == 1) one_s = run.wall_s;
    speed_up.push_back(one_s / run.wall_s);
    const double efficiency = speed_up.back() / workers;
    const auto ended = [&](tasks::Kind kind) { return run.ended_s[static_cast<std::size_t>(kind)]; };
    fmt::print("| {} | {:.1f} | {:.3f} | {:.1f} | {:.1f} | {:.1f} | {:.1f} | {:.1f} |\n", workers, run.wall_s, efficiency,
               ended(tasks::Kind::kTessellate), ended(tasks::Kind::kStretch), ended(tasks::Kind::kGuide), ended(tasks::Kind::kTrack),
               ended(tasks::Kind::kAssemble));
    bench_case.quality[fmt::format("wall_s_{}", workers)] = run.wall_s;
    bench_case.quality[fmt::format("min_efficiency_{}", workers)] = efficiency;
  }
  bench_case.cpu_s = CpuSeconds() - cpu_before;
  report.Add(std::move(bench_case));
  return picture.empty() ? absl::OkStatus() : DrawCurve(picture, frames, speed_up);
}

}  // namespace
}  // namespace vorocast::bench

int main(int argc, char** argv) {
  using namespace vorocast::bench;
  BenchReport report(argc, argv);
  std::int32_t frames = kFrames;
  std::string picture;
  const std::vector<std::string>& arguments = report.arguments();
  for (std::size_t i = 0; i + 1 < arguments.size(); ++i) {
    if (arguments[i] == "--frames") frames = std::max(1, std::atoi(arguments[i + 1].c_str()));
    if (arguments[i] == "--picture") picture = arguments[i + 1];
  }
  absl::Status status = Run(report, frames, picture);
  if (status.ok()) status = report.Write();
  if (!status.ok()) fmt::print(stderr, "bench_scaling: {}\n", std::string(status.message()));
  return status.ok() ? 0 : 1;
}
