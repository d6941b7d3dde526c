// SPDX-License-Identifier: AGPL-3.0-or-later
// What a tessellation costs and how good it is: CPU seconds of one core and G3, beside the goals.
//   bench_cvt [FRAME]   a frame's file in metres, y up; by default crane's first frame if it is there, else a frame made up here
#include <cstdlib>
#include <ctime>
#include <filesystem>
#include <string>

#include <fmt/format.h>

#include "services/capture/frame_reader.h"
#include "services/geometry/triangle_mesh.h"
#include "services/synth/synth.h"
#include "workers/cvt/indicator.h"
#include "workers/cvt/tessellate.h"

namespace vorocast {
namespace {

double CpuSeconds() {
  timespec now{};
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

struct Goal {
  std::int32_t cells, iterations;
  double cpu_s, g3;
};

std::string DefaultFrame() {
  const char* data = std::getenv("VOROCAST_DATA");
  const std::filesystem::path folder = data ? std::filesystem::path(data) : std::filesystem::path(VOROCAST_SOURCE_DIR) / ".." / "shared" / "data";
  const std::filesystem::path crane = folder / "crane" / "frame_0000.ply";
  if (std::filesystem::exists(crane)) return crane.lexically_normal().string();
  const std::filesystem::path made_up = std::filesystem::temp_directory_path() / "vorocast-bench-capture";
  std::filesystem::remove_all(made_up);
  synth::SynthOptions options;
  options.frames = 1;
  return synth::SynthesiseCapture(made_up, options).ok() ? (made_up / "frame_0000.ply").string() : "";
}

absl::Status Bench(const std::string& path) {
  ASSIGN_OR_RETURN(const capture::Frame frame, capture::ReadFrame(path, {}));
  const bool mesh = !frame.mesh.triangles.empty();
  ASSIGN_OR_RETURN(const cvt::Shape shape, mesh ? cvt::ShapeFromMesh(frame.mesh, {}, nullptr) : cvt::ShapeFromPoints(frame.points, {}, nullptr));
  fmt::print("{}: {} triangles, {} components, {:.4f} m3\n", std::filesystem::path(path).filename().string(), shape.surface.triangles.size(),
             shape.component_count, geometry::SignedVolume(shape.surface));
  fmt::print("{:>6} {:>10} {:>8} {:>8} {:>8} {:>9} {:>9} {:>12}\n", "cells", "iterations", "start", "CPU s", "goal", "G3", "goal", "evaluations");
  for (const Goal& goal : {Goal{5000, 10, 0.40, 0.0819}, Goal{5000, 50, 1.6, 0.0807}, Goal{14455, 10, 1.0, 0.0814}}) {
    for (const cvt::Start start : {cvt::Start::kLattice, cvt::Start::kRandom}) {
      cvt::TessellateOptions options;
      options.cells = goal.cells;
      options.iterations = goal.iterations;
      options.start = start;
      cvt::TessellateSummary summary;
      const double begin = CpuSeconds();
      ASSIGN_OR_RETURN(const geometry::Cells cells, cvt::Tessellate(shape, options, &summary, {}));
      fmt::print("{:>6} {:>10} {:>8} {:>8.2f} {:>8.2f} {:>9.5f} {:>9.4f} {:>12}\n", cells.size(), goal.iterations,
                 start == cvt::Start::kLattice ? "lattice" : "random", CpuSeconds() - begin, goal.cpu_s, geometry::NormalisedSecondMoment(cells),
                 goal.g3, summary.evaluations);
    }
  }
  return absl::OkStatus();
}

}  // namespace
}  // namespace vorocast

int main(int argc, char** argv) {
  const absl::Status status = vorocast::Bench(argc > 1 ? argv[1] : vorocast::DefaultFrame());
  if (!status.ok()) fmt::print(stderr, "bench_cvt: {}\n", std::string(status.message()));
  return status.ok() ? 0 : 1;
}
