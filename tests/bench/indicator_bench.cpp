// SPDX-License-Identifier: AGPL-3.0-or-later
// The indicator beside its peer, CGAL's Poisson on the same points and grid, in one run: CPU time and distances to the points and the truth.
// Usage: bench_indicator [points] [crane frame]. Prints the ratio to the peer and to the goal.
#include <fmt/format.h>

#include <algorithm>
#include <cstdlib>
#include <ctime>
#include <numbers>
#include <string>
#include <vector>

#include "tests/unit/workers/cvt/indicator_scenes.h"
#include "workers/cvt/indicator.h"

namespace vorocast::cvt {
namespace {

using geometry::OrientedPoints;
using geometry::TriangleMesh;
using geometry::Vec3;

constexpr double kGoalSeconds = 0.3;
constexpr double kNoise = 0.001;

double CpuSeconds() {
  timespec time{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &time);
  return static_cast<double>(time.tv_sec) + 1e-9 * static_cast<double>(time.tv_nsec);
}

struct Row {
  double seconds = 0;
  scenes::Distances points, truth, surface;
};

/// The least of `runs` runs: the machine's other work only ever adds.
Row Run(const OrientedPoints& points, const TriangleMesh* truth, IndicatorMethod method, int runs) {
  Row row;
  row.seconds = 1e9;
  absl::StatusOr<Shape> shape;
  for (int run = 0; run < runs; ++run) {
    const double start = CpuSeconds();
    shape = ShapeFromPoints(points, {.method = method}, nullptr);
    row.seconds = std::min(row.seconds, CpuSeconds() - start);
  }
  if (!shape.ok()) {
    fmt::print("{}\n", std::string(shape.status().message()));
    std::exit(1);
  }
  const scenes::DistanceTo to_surface(shape->surface);
  row.points = scenes::Measure(points.positions, to_surface);
  if (truth != nullptr) {
    row.truth = scenes::Measure(geometry::SampleSurface(*truth, 50'000, 2).positions, to_surface);
    row.surface = scenes::Measure(geometry::SampleSurface(shape->surface, 50'000, 3).positions, scenes::DistanceTo(*truth));
  }
  return row;
}

void Print(const char* name, const Row& row) {
  const auto pair = [](const scenes::Distances& d) {
    return d.mean > 0 ? fmt::format("{:6.3f} {:7.3f}", 1000 * d.mean, 1000 * d.percentile95) : fmt::format("{:>6} {:>7}", "-", "-");
  };
  fmt::print("{:<20} {:7.3f}   {}   {}   {}\n", name, row.seconds, pair(row.points), pair(row.truth), pair(row.surface));
}

void Compare(const std::string& title, const OrientedPoints& points, const TriangleMesh* truth) {
  fmt::print("\n{}: {} points\n{:<20} {:>7}   {:<14}   {:<14}   {:<14}\n", title, points.size(), "mm: mean, 95 %", "CPU s", "points",
             "truth->surface", "surface->truth");
  const Row fast = Run(points, truth, IndicatorMethod::kSpectral, 3);
  const Row cgal = Run(points, truth, IndicatorMethod::kCgal, 1);
  Print("spectral", fast);
  Print("CGAL Poisson", cgal);
  fmt::print("time / CGAL's {:.3f}, time / goal {:.2f}, distance to the points / CGAL's {:.3f}\n", fast.seconds / cgal.seconds,
             fast.seconds / kGoalSeconds, fast.points.mean / cgal.points.mean);
}

/// A figure-sized shape that needs no capture: a wavy torus standing upright.
TriangleMesh WavyTorus() {
  constexpr std::int32_t kAround = 400;
  constexpr std::int32_t kAcross = 120;
  TriangleMesh mesh;
  for (std::int32_t i = 0; i < kAround; ++i) {
    for (std::int32_t j = 0; j < kAcross; ++j) {
      const double u = 2 * std::numbers::pi * i / kAround;
      const double v = 2 * std::numbers::pi * j / kAcross;
      const double tube = 0.12 + 0.02 * std::sin(9 * u) * std::cos(3 * v);
      const double ring = 0.75 + tube * std::cos(v);
      mesh.vertices.emplace_back(ring * std::cos(u), ring * std::sin(u), tube * std::sin(v));
      const auto at = [&](std::int32_t a, std::int32_t b) { return (i + a) % kAround * kAcross + (j + b) % kAcross; };
      mesh.triangles.push_back({at(0, 0), at(1, 0), at(1, 1)});
      mesh.triangles.push_back({at(0, 0), at(1, 1), at(0, 1)});
    }
  }
  return mesh;
}

}  // namespace
}  // namespace vorocast::cvt

int main(int argc, char** argv) {
  using namespace vorocast::cvt;
  const std::size_t count = argc > 1 ? std::strtoul(argv[1], nullptr, 10) : 65'386;
  const int frame = argc > 2 ? std::atoi(argv[2]) : 40;
  const auto torus = WavyTorus();
  Compare("wavy torus, 1 mm noise", scenes::Scan(torus, count, kNoise, 1), &torus);
  if (const auto crane = scenes::Crane(frame)) {
    Compare(fmt::format("crane frame {}, 1 mm noise", frame), scenes::Scan(*crane, count, kNoise, 1), &*crane);
  } else {
    fmt::print("no crane capture in {}; set VOROCAST_DATA\n", scenes::DataFolder().string());
  }
  if (const auto kinoptic = scenes::Kinoptic(395)) Compare("kinoptic frame 395 (no truth)", *kinoptic, nullptr);
}
