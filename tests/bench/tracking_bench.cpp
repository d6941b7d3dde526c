// SPDX-License-Identifier: AGPL-3.0-or-later
// Tracking against known motion, as a user would run it: every frame made into cells (10 iterations), a template (50), the guide, windows, assembly.
// Prints how far material points are from where they truly went, and CPU seconds a frame, beside the goals; then one frame's poses beside Ceres.
// Usage: bench_tracking [dancer|crane] [first:last] [template frame] [--json FILE]. `crane` is looked for in ../shared/data (VOROCAST_DATA
// overrides); it is the default where it is there.
#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <map>
#include <numeric>
#include <set>
#include <string>
#include <vector>

#include "services/base/random.h"
#include "services/capture/frame_reader.h"
#include "services/storage/truth.h"
#include "services/synth/synth.h"
#include "tests/bench/bench_report.h"
#include "tests/bench/tracking_ceres.h"
#include "workers/cvt/indicator.h"
#include "workers/cvt/tessellate.h"
#include "workers/tracking/tracking.h"

namespace vorocast::tracking {
namespace {

using bench::CpuSeconds;
using geometry::Vec3;

constexpr double kGoalMeanMm = 2;
constexpr double kGoalHighMm = 6;
constexpr double kGoalSeconds = 0.1;
constexpr std::int32_t kCells = 5000;
constexpr std::int32_t kPatches = 200;
constexpr std::size_t kPoints = 65'000;
constexpr double kNoise = 0.001;
constexpr std::int32_t kWindow = 10;
constexpr std::int32_t kOverlap = 1;

template <typename T>
T OrExit(absl::StatusOr<T> result) {
  if (!result.ok()) {
    fmt::print(stderr, "{}\n", std::string(result.status().message()));
    std::exit(1);
  }
  return *std::move(result);
}

struct Range {
  std::int32_t first = 0;
  std::int32_t last = 60;
};

/// Frames to be tracked, and where material points of the surface truly are in each.
struct KnownTake {
  std::vector<Observation> frames;
  std::vector<std::vector<Vec3>> truth;  // [F][k]
};

KnownTake Crane(const Range& range) {
  const std::filesystem::path folder = bench::DataFolder();
  KnownTake take;
  for (std::int32_t f = range.first; f < range.last; ++f) {
    const auto raw = OrExit(capture::ReadRawFrame(folder / "crane" / fmt::format("frame_{:04}.ply", f)));
    Observation observation;
    observation.frame = f;
    observation.surface = geometry::SampleSurface(raw.mesh, kPoints, 1000 + static_cast<std::uint64_t>(f));
    base::Random random(static_cast<std::uint64_t>(f));
    for (Vec3& x : observation.surface.positions) x += kNoise * Vec3(random.Gaussian(), random.Gaussian(), random.Gaussian());
    take.frames.push_back(std::move(observation));
    take.truth.push_back(raw.mesh.vertices);
  }
  return take;
}

KnownTake Dancer(const Range& range) {
  const auto folder = std::filesystem::temp_directory_path() / fmt::format("vorocast_bench_tracking_{}", getpid());
  synth::SynthOptions options;
  options.frames = range.last;
  options.points = kPoints;
  options.noise_m = kNoise;
  if (const absl::Status status = synth::SynthesiseCapture(folder, options); !status.ok()) OrExit(absl::StatusOr<int>(status));
  storage::Truth truth = OrExit(storage::ReadTruth(folder / "truth.h5"));
  KnownTake take;
  for (std::int32_t f = range.first; f < range.last; ++f) {
    Observation observation;
    observation.frame = f;
    observation.surface = OrExit(capture::ReadFrame(folder / fmt::format("frame_{:04}.ply", f), {})).points;
    take.frames.push_back(std::move(observation));
    take.truth.push_back(std::move(truth.points[f]));
  }
  std::filesystem::remove_all(folder);
  return take;
}

/// The cells of each frame become its inner points; those of the template's frame, better optimised, the template.
geometry::Template Tessellate(KnownTake& take, std::int32_t template_frame) {
  geometry::Template model;
  for (Observation& observation : take.frames) {
    const bool chosen = observation.frame == template_frame;
    const cvt::Shape shape = OrExit(cvt::ShapeFromPoints(observation.surface, {}, nullptr));
    const auto cells = OrExit(cvt::Tessellate(shape, {.cells = kCells, .iterations = 10}, nullptr, {}));
    observation.inner = cells.centroid;
    observation.inner_depth = cells.depth;
    if (!chosen) continue;
    model.cells = OrExit(cvt::Tessellate(shape, {.cells = kCells, .iterations = 50}, nullptr, {}));
    model.frame = template_frame;
    model.patch = OrExit(ClusterPatches(model.cells, kPatches, 1));
    model.patch_count = 1 + *std::ranges::max_element(model.patch);
  }
  return model;
}

/// Material points that the template's frame shows: in a cubic centimetre with an observed point. Legs under a skirt are no part of the template.
std::vector<std::size_t> SeenPoints(const std::vector<Vec3>& points, const geometry::OrientedPoints& observed) {
  constexpr double kNear = 0.01;
  const auto cube_of = [](const Vec3& x) {
    return std::array{static_cast<int>(std::floor(x.x() / kNear)), static_cast<int>(std::floor(x.y() / kNear)),
                      static_cast<int>(std::floor(x.z() / kNear))};
  };
  std::set<std::array<int, 3>> cubes;
  for (const Vec3& x : observed.positions) cubes.insert(cube_of(x));
  std::vector<std::size_t> seen;
  for (std::size_t i = 0; i < points.size(); ++i) {
    if (cubes.contains(cube_of(points[i]))) seen.push_back(i);
  }
  return seen;
}

/// Prints a line and returns its figures.
std::map<std::string, double> PrintErrors(const char* name, const geometry::TrackedTake& take, const KnownTake& known, double seconds) {
  const auto row = static_cast<std::size_t>(std::ranges::find(take.patches.frames, take.model.frame) - take.patches.frames.begin());
  const std::vector<std::size_t> seen = SeenPoints(known.truth[row], known.frames[row].surface);
  std::vector<Vec3> points;
  for (const std::size_t i : seen) points.push_back(known.truth[row][i]);
  const auto carried = CarryPoints(take, points);
  std::vector<double> errors;
  for (std::size_t f = 0; f < known.truth.size(); ++f) {
    for (std::size_t i = 0; i < points.size(); ++i) errors.push_back(1000 * (carried[f * points.size() + i] - known.truth[f][seen[i]]).norm());
  }
  std::ranges::sort(errors);
  const auto& residual = take.patches.residual;
  const double frames = static_cast<double>(known.truth.size());
  const double mean = std::accumulate(errors.begin(), errors.end(), 0.0) / static_cast<double>(errors.size());
  const double median = errors[errors.size() / 2];
  const double high = errors[errors.size() * 95 / 100];
  const double residual_mm = 1000 * std::accumulate(residual.begin(), residual.end(), 0.0) / frames;
  fmt::print("{:<10} {:8.2f} {:8.2f} {:8.2f} {:8.2f}  {:9.2f}  {:9.4f}\n", name, mean, median, high, errors.back(), residual_mm, seconds / frames);
  return {{"mean_mm", mean}, {"median_mm", median}, {"p95_mm", high}, {"max_mm", errors.back()}, {"residual_mm", residual_mm}};
}

std::vector<geometry::PoseTrack> TrackWindows(const geometry::Template& model, const KnownTake& take, const geometry::PoseTrack& guide) {
  std::vector<geometry::PoseTrack> windows;
  const auto count = static_cast<std::int32_t>(take.frames.size());
  for (std::int32_t first = 0;; first += kWindow - kOverlap) {
    const std::int32_t last = std::min(count, first + kWindow);
    const std::vector<Observation> window(take.frames.begin() + first, take.frames.begin() + last);
    windows.push_back(OrExit(TrackWindow(model, window, guide, {}, {})));
    if (last == count) return windows;
  }
}

void Run(const std::string& what, KnownTake take, std::int32_t template_frame, bench::BenchReport& report) {
  double start = CpuSeconds();
  const auto lap = [&] {
    const double before = start;
    start = CpuSeconds();
    return start - before;
  };
  const geometry::Template model = Tessellate(take, template_frame);
  fmt::print("{} frames, {} cells, {} patches; tessellation {:.3f} s a frame\n", take.frames.size(), model.cells.size(), model.patch_count,
             lap() / static_cast<double>(take.frames.size()));
  fmt::print("{:<10} {:>8} {:>8} {:>8} {:>8}  {:>9}  {:>9}\n", "mm", "mean", "median", "95 %", "max", "residual", "CPU s");
  AssembleOptions options;
  for (const Observation& observation : take.frames) options.frames.push_back(observation.frame);
  lap();
  const geometry::PoseTrack guide = OrExit(Guide(model, take.frames, {}, {}));
  const double guide_seconds = lap();
  PrintErrors("guide", OrExit(Assemble(model, {guide}, options)), take, guide_seconds);
  lap();
  const auto windows = TrackWindows(model, take, guide);
  const double track_seconds = lap();
  const auto tracked = OrExit(Assemble(model, windows, options));
  const double assemble_seconds = lap();
  bench::BenchCase result;
  result.quality = PrintErrors("windows", tracked, take, track_seconds);
  const double seconds = (guide_seconds + track_seconds + assemble_seconds) / static_cast<double>(take.frames.size());
  fmt::print("{:<10} {:8.2f} {:>8} {:8.2f} {:>8}  {:>9}  {:9.4f}\n", "goal", kGoalMeanMm, "", kGoalHighMm, "", "", kGoalSeconds);
  fmt::print("all of it {:.4f} s a frame, {:.2f} of the goal; windows of {} share {} frame, tracked twice\n", seconds, seconds / kGoalSeconds,
             kWindow, kOverlap);
  result.name = "tracking-65k";
  result.input = fmt::format("{}, frames {} to {}, {} points, 1 mm noise, {} cells, {} patches; seconds a frame, guide and assembly included", what,
                             take.frames.front().frame, take.frames.back().frame, kPoints, model.cells.size(), model.patch_count);
  result.cpu_s = seconds;
  result.goal = {{"cpu_s", kGoalSeconds}, {"mean_mm", kGoalMeanMm}, {"p95_mm", kGoalHighMm}};
  report.Add(std::move(result));

  // From the pose of the frame before, as far as one frame moves.
  const std::size_t middle = take.frames.size() / 2;
  std::vector<geometry::Rigid3> before;
  for (std::int32_t k = 0; k < model.patch_count; ++k) {
    before.push_back(tracked.patches.Pose(middle > 0 ? middle - 1 : 0, static_cast<std::size_t>(k)));
  }
  bench::CompareWithCeres(model, take.frames[middle], before, report);
}

}  // namespace
}  // namespace vorocast::tracking

int main(int argc, char** argv) {
  using vorocast::tracking::Range;
  vorocast::bench::BenchReport report(argc, argv);
  const auto& arguments = report.arguments();
  const bool crane_is_there = std::filesystem::exists(std::filesystem::path(vorocast::bench::DataFolder()) / "crane");
  const std::string what = !arguments.empty() ? arguments[0] : crane_is_there ? "crane" : "dancer";
  Range range;
  if (arguments.size() > 1 && std::sscanf(arguments[1].c_str(), "%d:%d", &range.first, &range.last) != 2) {
    return fmt::print(stderr, "frames are given as first:last\n"), 1;
  }
  const std::int32_t template_frame = arguments.size() > 2 ? std::atoi(arguments[2].c_str()) : range.first;
  if (range.first < 0 || range.last <= range.first || template_frame < range.first || template_frame >= range.last) {
    return fmt::print(stderr, "the template's frame must be one of {}:{}\n", range.first, range.last), 1;
  }
  if (what != "dancer" && what != "crane") return fmt::print(stderr, "'{}' is neither dancer nor crane\n", what), 1;
  fmt::print("{}, {} points a frame, {} mm noise, template frame {}\n", what, vorocast::tracking::kPoints, 1000 * vorocast::tracking::kNoise,
             template_frame);
  vorocast::tracking::Run(what, what == "crane" ? vorocast::tracking::Crane(range) : vorocast::tracking::Dancer(range), template_frame, report);
  const absl::Status written = report.Write();
  if (!written.ok()) fmt::print(stderr, "bench_tracking: {}\n", std::string(written.message()));
  return written.ok() ? 0 : 1;
}
