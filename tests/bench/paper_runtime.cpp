// SPDX-License-Identifier: AGPL-3.0-or-later
#include "tests/bench/paper_runtime.h"

#include <algorithm>
#include <vector>

#include "services/simulation/effect.h"
#include "services/simulation/simulation_run.h"
#include "services/storage/hdf5_artifacts.h"
#include "tests/bench/bench_report.h"
#include "workers/cvt/indicator.h"
#include "workers/cvt/tessellate.h"
#include "workers/tracking/tracking.h"

namespace vorocast::bench {
namespace {

constexpr std::int32_t kCells = 5000;
constexpr std::int32_t kPatches = 200;
constexpr double kStep_s = 1.0 / 240;
constexpr double kBeforeTheHit_s = 0.9;
constexpr double kAfterTheHit_s = 2.5;

/// What passed since the last call.
class Stopwatch {
 public:
  double Lap() {
    const double before = last_;
    last_ = CpuSeconds();
    return last_ - before;
  }

 private:
  double last_ = CpuSeconds();
};

struct Modelled {
  geometry::Template model;
  std::vector<tracking::Observation> frames;
};

absl::StatusOr<Modelled> Model(const PaperTake& take, std::map<std::string, double>& seconds) {
  Modelled modelled;
  const auto count = static_cast<double>(take.capture.frames.size());
  for (std::size_t f = 0; f < take.capture.frames.size(); ++f) {
    tracking::Observation observation;
    observation.frame = static_cast<std::int32_t>(f);
    ASSIGN_OR_RETURN(observation.surface, ReadPoints(take, f));
    Stopwatch watch;
    ASSIGN_OR_RETURN(const cvt::Shape shape, cvt::ShapeFromPoints(observation.surface, {}, nullptr));
    seconds["poisson"] += watch.Lap() / count;
    ASSIGN_OR_RETURN(geometry::Cells cells, cvt::Tessellate(shape, {.cells = kCells, .iterations = 10}, nullptr, {}));
    seconds["cells"] += watch.Lap() / count;
    if (f == 0) {
      ASSIGN_OR_RETURN(modelled.model.cells, cvt::Tessellate(shape, {.cells = kCells, .iterations = 50}, nullptr, {}));
      seconds["template"] = watch.Lap();
      modelled.model.cells.surface = observation.surface;
    }
    observation.inner = std::move(cells.centroid);
    observation.inner_depth = std::move(cells.depth);
    modelled.frames.push_back(std::move(observation));
  }
  ASSIGN_OR_RETURN(modelled.model.patch, tracking::ClusterPatches(modelled.model.cells, kPatches, 1));
  modelled.model.patch_count = 1 + std::ranges::max(modelled.model.patch);
  return modelled;
}

absl::StatusOr<geometry::TrackedTake> Track(const Modelled& modelled, std::map<std::string, double>& seconds) {
  tracking::AssembleOptions options;
  for (const tracking::Observation& frame : modelled.frames) options.frames.push_back(frame.frame);
  Stopwatch watch;
  ASSIGN_OR_RETURN(const geometry::PoseTrack guide, tracking::Guide(modelled.model, modelled.frames, {}, {}));
  ASSIGN_OR_RETURN(const geometry::PoseTrack window, tracking::TrackWindow(modelled.model, modelled.frames, guide, {}, {}));
  ASSIGN_OR_RETURN(geometry::TrackedTake tracked, tracking::Assemble(modelled.model, {window}, options));
  seconds["tracking"] = watch.Lap() / static_cast<double>(modelled.frames.size());
  return tracked;
}

absl::StatusOr<double> SecondsAStep(const geometry::TrackedTake& take) {
  ASSIGN_OR_RETURN(const nlohmann::json canonical, simulation::LoadEffect("pendulum"));
  ASSIGN_OR_RETURN(const simulation::Effect effect, simulation::EffectFromCanonicalJson(canonical));
  const simulation::TrackedMotion motion(take);
  const auto shapes = simulation::MakeCellShapes(take.model.cells, effect.cells);
  ASSIGN_OR_RETURN(const simulation::Scene scene, simulation::MakeScene(effect, take.model.cells, motion));
  simulation::SimulationRun run(effect, motion, scene, shapes, kStep_s);
  while (run.time() < kBeforeTheHit_s) RETURN_IF_ERROR(run.Step(kStep_s));
  Stopwatch watch;
  int steps = 0;
  for (; run.time() < kAfterTheHit_s; ++steps) RETURN_IF_ERROR(run.Step(kStep_s));
  return watch.Lap() / steps;
}

}  // namespace

absl::StatusOr<std::map<std::string, double>> MeasureRunTime(const PaperTake& take, const std::filesystem::path& tracked_file) {
  std::map<std::string, double> seconds;
  ASSIGN_OR_RETURN(const Modelled modelled, Model(take, seconds));
  ASSIGN_OR_RETURN(const geometry::TrackedTake tracked, Track(modelled, seconds));
  RETURN_IF_ERROR(storage::WriteTrackedTake(tracked_file, tracked, {.kind = "assemble", .options_json = "{}"}));
  ASSIGN_OR_RETURN(seconds["simulation"], SecondsAStep(tracked));
  return seconds;
}

}  // namespace vorocast::bench
