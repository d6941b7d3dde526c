// SPDX-License-Identifier: AGPL-3.0-or-later
#include "services/simulation/simulate.h"

#include <memory>

#include "services/simulation/effect.h"
#include "services/simulation/effect_run.h"

namespace vorocast::simulation {

absl::StatusOr<geometry::SimulatedTake> Simulate(const geometry::TrackedTake& take, const nlohmann::json& effect_json, const base::Progress& progress,
                                                 const Cancelled& cancelled, const geometry::TrackedTake* target) {
  ASSIGN_OR_RETURN(const nlohmann::json canonical, NormaliseEffect(effect_json));
  ASSIGN_OR_RETURN(const std::unique_ptr<EffectRun> run, EffectRun::Start(take, canonical));
  const Effect& effect = run->effect();
  if (effect.morph && target == nullptr) {
    return absl::InvalidArgumentError("effect: morph: it needs a second tracked take to turn this one into, and there is none");
  }
  if (effect.morph) {
    if (const absl::Status status = CheckTake(*target); !status.ok()) return base::Annotate(status, "the take to turn into");
  }

  geometry::SimulatedTake result;
  result.effect_json = canonical.dump();
  for (const SceneBody& body : run->scene().bodies) result.objects.push_back({body.name, body.mesh});
  run->Record(result);
  while (run->instant() + 1 < run->instants()) {
    RETURN_IF_ERROR(run->Advance(cancelled));
    run->Record(result);
    base::Report(progress, static_cast<double>(run->instant() + 1) / static_cast<double>(run->instants()));
  }
  result.step_count = run->step_count();
  if (effect.morph) AddMorph(*effect.morph, run->motion(), TrackedMotion(*target), result);
  RETURN_IF_ERROR(AddCopies(effect.persistence, run->subject(), result));
  return result;
}

}  // namespace vorocast::simulation
