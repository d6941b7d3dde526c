// SPDX-License-Identifier: AGPL-3.0-or-later
#include "services/simulation/effect_run.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

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

/// The first field that the world is built of and that differs; empty if none does.
std::string BuiltIn(const nlohmann::json& before, const nlohmann::json& after) {
  for (const char* field : {"cells", "ground", "objects", "output_fps", "morph"}) {
    if (before.at(field) != after.at(field)) return field;
  }
  for (const char* field : {"between", "mask"}) {
    if (before.at("bonds").at(field) != after.at("bonds").at(field)) return std::string("bonds.") + field;
  }
  return "";
}

}  // namespace

EffectRun::EffectRun(const geometry::TrackedTake& take, const nlohmann::json& canonical, Effect effect)
    : cells_(take.model.cells),
      canonical_(canonical),
      effect_(std::move(effect)),
      motion_(take),
      shapes_(MakeCellShapes(cells_, effect_.cells)),
      frame_time_(1 / effect_.output_fps.value_or(take.frames_per_second)) {}

absl::StatusOr<std::unique_ptr<EffectRun>> EffectRun::Start(const geometry::TrackedTake& take, const nlohmann::json& canonical) {
  ASSIGN_OR_RETURN(Effect effect, EffectFromCanonicalJson(canonical));
  RETURN_IF_ERROR(CheckTake(take));
  std::unique_ptr<EffectRun> made(new EffectRun(take, canonical, std::move(effect)));
  ASSIGN_OR_RETURN(made->scene_, MakeScene(made->effect_, made->cells_, made->motion_));
  RETURN_IF_ERROR(made->Count());
  const double first_dt = made->frame_time_ / StepsInFrame(made->effect_, 0, made->frame_time_);
  made->run_ = std::make_unique<SimulationRun>(made->effect_, made->motion_, made->scene_, made->shapes_, first_dt);
  return made;
}

absl::Status EffectRun::Count() {
  const double instants = std::floor(Duration(effect_, motion_) / frame_time_ + 1e-6) + 1;
  if (instants > kInstantsMax) {
    return absl::InvalidArgumentError(fmt::format("effect: duration_s: {} stored frames; at most {} can be stored", instants, kInstantsMax));
  }
  instants_ = static_cast<std::size_t>(instants);
  return absl::OkStatus();
}

absl::Status EffectRun::Advance(const Cancelled& cancelled) {
  const int steps = StepsInFrame(effect_, run_->FastestForeign(), frame_time_);
  for (int i = 0; i < steps; ++i) {
    if (cancelled && cancelled()) return absl::CancelledError("simulation cancelled");
    RETURN_IF_ERROR(run_->Step(frame_time_ / steps));
  }
  step_count_ += steps;
  ++instant_;
  return absl::OkStatus();
}

void EffectRun::Record(geometry::SimulatedTake& result) const {
  result.time.push_back(time());
  run_->Record(cells_, result);
  result.cell_penetration_m = run_->deepest_penetration().cells;
  result.cell_overlap_m = run_->deepest_penetration().begun;
  result.object_penetration_m = run_->deepest_penetration().objects;
  result.ground_penetration_m = run_->deepest_penetration().ground;
}

absl::Status EffectRun::Change(const nlohmann::json& canonical) {
  if (const std::string field = BuiltIn(canonical_, canonical); !field.empty()) {
    return absl::FailedPreconditionError(
        fmt::format("effect: {}: the world is built with it before the first frame, so it can be changed at frame 0 only: rewind to 0 first", field));
  }
  ASSIGN_OR_RETURN(Effect effect, EffectFromCanonicalJson(canonical));
  Effect before = std::exchange(effect_, std::move(effect));
  if (const absl::Status status = Count(); !status.ok()) {
    effect_ = std::move(before);
    return status;
  }
  run_->EffectChanged(canonical_.at("distortion") != canonical.at("distortion"));
  canonical_ = canonical;
  return absl::OkStatus();
}

}  // namespace vorocast::simulation
