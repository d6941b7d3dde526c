// SPDX-License-Identifier: AGPL-3.0-or-later
// What a simulation step costs, by what the cells are doing: CPU milliseconds a step on one core, beside its goal.
#include <algorithm>
#include <cstdlib>
#include <ctime>
#include <string>
#include <vector>

#include <fmt/format.h>
#include "services/simulation/effect.h"
#include "services/simulation/simulation_run.h"
#include "tests/unit/services/simulation/synthetic_take.h"

namespace {

using namespace vorocast;

constexpr double kRate = 240;

double CpuMilliseconds() {
  timespec now{};
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &now);
  return 1e3 * static_cast<double>(now.tv_sec) + 1e-6 * static_cast<double>(now.tv_nsec);
}

struct Case {
  const char* name;
  testing::Motion motion;
  nlohmann::json effect;
  double from_s, to_s;  // the steps that count
  double goal_ms;
};

void Measure(const geometry::Cells& cells, const Case& one) {
  const geometry::TrackedTake take = testing::Animate(cells, static_cast<std::size_t>(25 * one.to_s) + 2, 25, one.motion);
  nlohmann::json json = one.effect;
  json["name"] = one.name;
  const auto canonical = simulation::NormaliseEffect(json);
  if (!canonical.ok()) {
    fmt::print(stderr, "{}\n", std::string(canonical.status().message()));
    std::exit(EXIT_FAILURE);
  }
  const simulation::Effect effect = *simulation::EffectFromCanonicalJson(*canonical);
  const simulation::TrackedMotion motion(take);
  const auto shapes = simulation::MakeCellShapes(take.model.cells, effect.cells);
  const simulation::Scene scene = *simulation::MakeScene(effect, take.model.cells, motion);
  simulation::SimulationRun run(effect, motion, scene, shapes, 1 / kRate);
  std::vector<double> steps;
  while (run.time() < one.to_s) {
    const bool counts = run.time() >= one.from_s;
    const double before = CpuMilliseconds();
    if (const absl::Status status = run.Step(1 / kRate); !status.ok()) {
      fmt::print(stderr, "{}\n", std::string(status.message()));
      std::exit(EXIT_FAILURE);
    }
    if (counts) steps.push_back(CpuMilliseconds() - before);
  }
  double mean = 0;
  for (const double step : steps) mean += step / static_cast<double>(steps.size());
  fmt::print("{:<44} {:>8.2f} ms a step, peak {:>7.2f}   goal {:>5.1f}   {:>5.2f} of it\n", one.name, mean, *std::ranges::max_element(steps),
             one.goal_ms, mean / one.goal_ms);
}

}  // namespace

int main(int argc, char** argv) {
  const int count = argc > 1 ? std::atoi(argv[1]) : 5000;
  const geometry::Cells cells = testing::Person(count);
  fmt::print("{} cells, {} steps a second, CPU time of one core\n", cells.size(), kRate);
  const nlohmann::json all = {{"release", {{{"by", "height"}, {"end_s", 0}}}}};
  const nlohmann::json half = {{"release", {{{"by", "height"}, {"end_s", 0}, {"share", 0.5}}}}};
  const nlohmann::json gradual = {{"release", {{{"by", "height"}, {"end_s", 1.6}}}}};
  const nlohmann::json pendulum = *simulation::LoadEffect("pendulum");
  const Case cases[] = {{"all recalled, standing", testing::Still, {}, 0, 1, 3},
                        {"all recalled, moving", testing::Sway, {}, 0, 1, 3},
                        {"pendulum, from the hit on", testing::Sway, pendulum, 0.9, 2.5, 30},
                        {"released from top to bottom, half way down", testing::Still, gradual, 0.7, 1.0, 30},
                        {"upper half released at once", testing::Still, half, 0.1, 1.5, 30},
                        {"all released at once, falling", testing::Still, all, 0.1, 0.7, 80},
                        {"all in a pile", testing::Still, all, 1.2, 2.2, 80}};
  for (const Case& one : cases) Measure(cells, one);
}
