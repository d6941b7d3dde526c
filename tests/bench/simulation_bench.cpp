// SPDX-License-Identifier: AGPL-3.0-or-later
// What a simulation step costs, by what the cells are doing: CPU seconds a step on one core, beside its goal, and Bullet as one would first write it.
//   bench_simulation [CELLS] [--json FILE]
#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <string>
#include <vector>

#include <fmt/format.h>

#include "services/simulation/effect.h"
#include "services/simulation/simulation_run.h"
#include "tests/bench/bench_report.h"
#include "tests/bench/peer_bullet.h"
#include "tests/unit/services/simulation/synthetic_take.h"

namespace vorocast::bench {
namespace {

constexpr double kRate = 240;
/// The paper's, section 6: whatever the cells do.
constexpr const char* kPaper = "the paper (2 x Xeon E5-2665, one thread)";
constexpr double kPaperStep_s = 0.350;
constexpr int kBulletCells = 1000;

struct Situation {
  const char* name;
  const char* what;
  testing::Motion motion;
  nlohmann::json effect;
  double from_s, to_s;  // the steps that count
  double goal_s;
};

/// The farthest that any cell is from its tracked pose: nothing may move when all are recalled at rest.
double DriftMax(const simulation::SimulationRun& run, const geometry::TrackedTake& take) {
  geometry::SimulatedTake recorded;
  run.Record(take.model.cells, recorded);
  double drift = 0;
  for (std::size_t c = 0; c < take.cell_count(); ++c) {
    const geometry::Vec3& centroid = take.model.cells.centroid[c];
    const Eigen::Vector4f& q = recorded.cell_rotation[c];
    const geometry::Rigid3 pose{geometry::Quat(q[0], q[1], q[2], q[3]).normalized(), recorded.cell_translation[c]};
    drift = std::max(drift, (pose * centroid - take.CellPose(0, c) * centroid).norm());
  }
  return drift;
}

absl::Status Measure(const geometry::Cells& cells, const Situation& situation, BenchReport& report) {
  const geometry::TrackedTake take = testing::Animate(cells, static_cast<std::size_t>(25 * situation.to_s) + 2, 25, situation.motion);
  nlohmann::json json = situation.effect;
  json["name"] = situation.what;
  ASSIGN_OR_RETURN(const nlohmann::json canonical, simulation::NormaliseEffect(json));
  ASSIGN_OR_RETURN(const simulation::Effect effect, simulation::EffectFromCanonicalJson(canonical));
  const simulation::TrackedMotion motion(take);
  const auto shapes = simulation::MakeCellShapes(take.model.cells, effect.cells);
  ASSIGN_OR_RETURN(const simulation::Scene scene, simulation::MakeScene(effect, take.model.cells, motion));
  simulation::SimulationRun run(effect, motion, scene, shapes, 1 / kRate);
  std::vector<double> steps;
  while (run.time() < situation.to_s) {
    const bool counts = run.time() >= situation.from_s;
    const double before = CpuSeconds();
    RETURN_IF_ERROR(run.Step(1 / kRate));
    if (counts) steps.push_back(CpuSeconds() - before);
  }
  BenchCase one;
  one.name = situation.name;
  one.input = fmt::format("{} cells, {}, {} steps of 1/{} s; seconds a step", cells.size(), situation.what, steps.size(), kRate);
  for (const double step : steps) one.cpu_s += step / static_cast<double>(steps.size());
  one.quality["peak_cpu_s"] = std::ranges::max(steps);
  one.goal["cpu_s"] = situation.goal_s;
  if (one.name == "sim-recalled") {
    one.quality["drift_max_mm"] = 1000 * DriftMax(run, take);
    one.goal["drift_max_mm"] = 0.001;
    // Every hull's margin reaches through its neighbours: 5000 of them take 14 s a step and 1.7 GB.
    const BulletSteps bullet = StepWithBullet(testing::Person(kBulletCells), 2);
    one.peer = fmt::format("Bullet 3.24 in metres with its default margin, {} cells only", kBulletCells);
    one.peer_cpu_s = bullet.cpu_s_a_step;
    one.peer_quality["drift_max_mm"] = 1000 * bullet.drift_max_m;
  } else {
    one.peer = kPaper;
    one.peer_cpu_s = kPaperStep_s;
  }
  report.Add(std::move(one));
  return absl::OkStatus();
}

absl::Status Bench(BenchReport& report) {
  const geometry::Cells cells = testing::Person(report.arguments().empty() ? 5000 : std::atoi(report.arguments()[0].c_str()));
  const nlohmann::json all = {{"release", {{{"by", "height"}, {"end_s", 0}}}}};
  const nlohmann::json half = {{"release", {{{"by", "height"}, {"end_s", 0}, {"share", 0.5}}}}};
  const nlohmann::json gradual = {{"release", {{{"by", "height"}, {"end_s", 1.6}}}}};
  ASSIGN_OR_RETURN(const nlohmann::json pendulum, simulation::LoadEffect("pendulum"));
  const Situation situations[] = {{"sim-recalled", "all recalled, standing", testing::Still, {}, 0, 1, 0.003},
                                  {"sim-recalled-moving", "all recalled, moving", testing::Sway, {}, 0, 1, 0.003},
                                  {"sim-pendulum", "pendulum, from the hit on", testing::Sway, pendulum, 0.9, 2.5, 0.030},
                                  {"sim-half-gradual", "released from top to bottom, half way down", testing::Still, gradual, 0.7, 1.0, 0.030},
                                  {"sim-half", "upper half released at once", testing::Still, half, 0.1, 1.5, 0.030},
                                  {"sim-falling", "all released at once, falling", testing::Still, all, 0.1, 0.7, 0.080},
                                  {"sim-pile", "all in a pile", testing::Still, all, 1.2, 2.2, 0.080}};
  for (const Situation& situation : situations) RETURN_IF_ERROR(Measure(cells, situation, report));
  return absl::OkStatus();
}

}  // namespace
}  // namespace vorocast::bench

int main(int argc, char** argv) { return vorocast::bench::RunBench("bench_simulation", argc, argv, vorocast::bench::Bench); }
