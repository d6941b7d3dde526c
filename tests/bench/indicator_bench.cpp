// SPDX-License-Identifier: AGPL-3.0-or-later
// The indicator beside its peer, CGAL's Poisson function and a surface cut from it on the same grid, in one run: CPU time and distances of both
// surfaces to the points and to the truth.
//   bench_indicator [POINTS] [CRANE_FRAME] [--json FILE]
#include <algorithm>
#include <cstdlib>
#include <string>

#include <fmt/format.h>

#include "tests/bench/bench_inputs.h"
#include "tests/bench/bench_report.h"
#include "tests/bench/surface_distance.h"
#include "workers/cvt/indicator.h"

namespace vorocast::bench {
namespace {

constexpr double kGoalSeconds = 0.3;

struct Made {
  double cpu_s = 0;
  std::map<std::string, double> quality;
};

void AddDistances(const std::string& name, const geometry::TriangleMesh& surface, const std::vector<geometry::Vec3>& points, Made& made) {
  const SurfaceDistances distances = DistancesTo(surface, points);
  made.quality[name + "_mean_mm"] = 1000 * distances.mean;
  made.quality[name + "_p95_mm"] = 1000 * distances.p95;
}

/// The time is the least of `runs`: the machine's other work only ever adds.
absl::StatusOr<Made> Make(const BenchFrame& frame, cvt::IndicatorMethod method, int runs) {
  Made made;
  cvt::Shape shape;
  for (int run = 0; run < runs; ++run) {
    const double begin = CpuSeconds();
    ASSIGN_OR_RETURN(shape, cvt::ShapeFromPoints(frame.points, {.method = method}, nullptr));
    const double cpu_s = CpuSeconds() - begin;
    made.cpu_s = run == 0 ? cpu_s : std::min(made.cpu_s, cpu_s);
  }
  AddDistances("points_to_surface", shape.surface, frame.points.positions, made);
  if (frame.truth) {
    AddDistances("truth_to_surface", shape.surface, geometry::SampleSurface(*frame.truth, 50'000, 2).positions, made);
    AddDistances("surface_to_truth", *frame.truth, geometry::SampleSurface(shape.surface, 50'000, 3).positions, made);
  }
  return made;
}

absl::Status Compare(const std::string& name, const BenchFrame& frame, BenchReport& report) {
  ASSIGN_OR_RETURN(const Made ours, Make(frame, cvt::IndicatorMethod::kSpectral, 3));
  ASSIGN_OR_RETURN(const Made theirs, Make(frame, cvt::IndicatorMethod::kCgal, 1));
  BenchCase one;
  one.name = name;
  one.input = fmt::format("{}, {} points{}", frame.name, frame.points.size(), frame.truth ? ", 1 mm noise" : "");
  one.cpu_s = ours.cpu_s;
  one.quality = ours.quality;
  one.goal["cpu_s"] = kGoalSeconds;
  // As precise as CGAL's; what is known to be true comes first.
  const std::string precision = frame.truth ? "truth_to_surface_mean_mm" : "points_to_surface_mean_mm";
  one.goal[precision] = theirs.quality.at(precision);
  one.peer = "CGAL 5.5 Poisson function, sampled on the same grid";
  one.peer_cpu_s = theirs.cpu_s;
  one.peer_quality = theirs.quality;
  report.Add(std::move(one));
  return absl::OkStatus();
}

absl::Status Bench(BenchReport& report) {
  const auto& arguments = report.arguments();
  const std::size_t count = !arguments.empty() ? std::strtoul(arguments[0].c_str(), nullptr, 10) : kPaperPoints;
  const int number = arguments.size() > 1 ? std::atoi(arguments[1].c_str()) : 40;
  ASSIGN_OR_RETURN(const BenchFrame frame, CraneOrSynthFrame(number, count));
  RETURN_IF_ERROR(Compare("indicator-65k", frame, report));
  if (const auto kinoptic = KinopticFrame(395); kinoptic.ok()) {
    RETURN_IF_ERROR(Compare("indicator-kinoptic", *kinoptic, report));
  } else {
    report.Skip("indicator-kinoptic", std::string(kinoptic.status().message()));
  }
  return absl::OkStatus();
}

}  // namespace
}  // namespace vorocast::bench

int main(int argc, char** argv) { return vorocast::bench::RunBench("bench_indicator", argc, argv, vorocast::bench::Bench); }
