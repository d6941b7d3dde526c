// SPDX-License-Identifier: AGPL-3.0-or-later
#include "services/simulation/simulate.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "services/simulation/effect.h"
#include "services/simulation/simulation_run.h"

namespace vorocast::simulation {
namespace {

constexpr double kSlowRate = 60;     // steps a second while nothing moves fast
constexpr double kTravelMax = 0.01;  // metres in one step, before the steps get shorter: less than half a cell
constexpr std::size_t kInstantsMax = 1000000;

/// How many equal steps lead to the next stored frame: as few as keep fast things from passing through cells.
int StepsInFrame(const Effect& effect, double fastest, double frame_time) {
  const auto steps = [&](double rate) { return std::max(1, static_cast<int>(std::ceil(rate * frame_time - 1e-9))); };
  const int most = steps(effect.rate_hz);
  const int fewest = steps(std::min(effect.rate_hz, kSlowRate));
  const double wanted = std::ceil(fastest * frame_time / kTravelMax);
  return static_cast<int>(std::clamp(wanted, static_cast<double>(fewest), static_cast<double>(most)));
}

}  // namespace

absl::StatusOr<geometry::SimulatedTake> Simulate(const geometry::TrackedTake& take, const nlohmann::json& effect_json, const base::Progress& progress,
                                                 const Cancelled& cancelled, const geometry::TrackedTake* target) {
  ASSIGN_OR_RETURN(const nlohmann::json canonical, NormaliseEffect(effect_json));
  ASSIGN_OR_RETURN(const Effect effect, EffectFromCanonicalJson(canonical));
  RETURN_IF_ERROR(CheckTake(take));
  if (effect.morph && target == nullptr) {
    return absl::InvalidArgumentError("effect: morph: it needs a second tracked take to turn this one into, and there is none");
  }
  if (effect.morph) {
    if (const absl::Status status = CheckTake(*target); !status.ok()) return base::Annotate(status, "the take to turn into");
  }

  const geometry::Cells& cells = take.model.cells;
  const TrackedMotion motion(take);
  const std::vector<CellShape> shapes = MakeCellShapes(cells, effect.cells);
  ASSIGN_OR_RETURN(const Scene scene, MakeScene(effect, cells, motion));

  const double fps = effect.output_fps.value_or(take.frames_per_second);
  const double frame_time = 1 / fps;
  const double duration = Duration(effect, motion);
  const double instants = std::floor(duration * fps + 1e-6) + 1;
  if (instants > kInstantsMax) {
    return absl::InvalidArgumentError(fmt::format("effect: duration_s: {} stored frames; at most {} can be stored", instants, kInstantsMax));
  }

  geometry::SimulatedTake result;
  result.effect_json = canonical.dump();
  for (const SceneBody& body : scene.bodies) result.objects.push_back({body.name, body.mesh});
  SimulationRun run(effect, motion, scene, shapes, frame_time / StepsInFrame(effect, 0, frame_time));
  for (std::size_t s = 0; s < static_cast<std::size_t>(instants); ++s) {
    if (s > 0) {
      const int steps = StepsInFrame(effect, run.FastestForeign(), frame_time);
      result.step_count += steps;
      for (int i = 0; i < steps; ++i) RETURN_IF_ERROR(run.Step(frame_time / steps));
    }
    result.time.push_back(static_cast<double>(s) * frame_time);
    run.Record(cells, result);
    base::Report(progress, static_cast<double>(s + 1) / instants);
    if (cancelled && cancelled()) return absl::CancelledError("simulation cancelled");
  }
  if (effect.morph) AddMorph(*effect.morph, motion, TrackedMotion(*target), result);
  RETURN_IF_ERROR(AddCopies(effect.persistence, run.subject(), result));
  result.cell_penetration_m = run.deepest_penetration().cells;
  result.object_penetration_m = run.deepest_penetration().objects;
  result.ground_penetration_m = run.deepest_penetration().ground;
  return result;
}

}  // namespace vorocast::simulation
