// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <vector>

#include <nlohmann/json.hpp>

#include "services/base/status.h"
#include "services/geometry/simulated_take.h"
#include "services/simulation/cell_shapes.h"
#include "services/simulation/effect_settings.h"
#include "services/simulation/scene.h"
#include "services/simulation/simulation_run.h"
#include "services/simulation/tracked_motion.h"

namespace vorocast::simulation {

/// Asked now and then by what takes long; true ends it with CANCELLED.
using Cancelled = std::function<bool()>;

/// One effect on one take, from stored instant to stored instant: what a batch run and a live session have in common, so that both give the same.
class EffectRun {
 public:
  /// `take` outlives this. `canonical`: as NormaliseEffect returns it. INVALID_ARGUMENT for a take or an effect that cannot be run.
  static absl::StatusOr<std::unique_ptr<EffectRun>> Start(const geometry::TrackedTake& take, const nlohmann::json& canonical);

  /// How many instants the effect stores, the first at time 0.
  std::size_t instants() const { return instants_; }
  /// Which of them the run is at; 0 after Start.
  std::size_t instant() const { return instant_; }
  double time() const { return static_cast<double>(instant_) * frame_time_; }
  double frame_time() const { return frame_time_; }  // seconds between them
  std::int64_t step_count() const { return step_count_; }

  /// To the next stored instant. INTERNAL when a state is no longer finite.
  absl::Status Advance(const Cancelled& cancelled);
  /// Appends the present instant, its time included; the deepest penetration so far is the result's.
  void Record(geometry::SimulatedTake& result) const;
  /// Goes on under another effect. FAILED_PRECONDITION names a field that is built into the world from the first instant on, and what to do.
  absl::Status Change(const nlohmann::json& canonical);

  const Effect& effect() const { return effect_; }
  const TrackedMotion& motion() const { return motion_; }
  const Scene& scene() const { return scene_; }
  const MaskSubject& subject() const { return run_->subject(); }

 private:
  EffectRun(const geometry::TrackedTake& take, const nlohmann::json& canonical, Effect effect);
  absl::Status Count();

  const geometry::Cells& cells_;
  nlohmann::json canonical_;
  Effect effect_;  // those below refer to it
  const TrackedMotion motion_;
  std::vector<CellShape> shapes_;
  Scene scene_;
  double frame_time_;
  std::size_t instants_ = 0;
  std::size_t instant_ = 0;
  std::int64_t step_count_ = 0;
  std::unique_ptr<SimulationRun> run_;
};

}  // namespace vorocast::simulation
