// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <cstddef>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "services/base/status.h"
#include "services/geometry/simulated_take.h"
#include "services/simulation/effect_run.h"

namespace vorocast::simulation {

/// An effect run whose settings may be changed between frames, and which can go back. What it gives depends only on which change came at which
/// frame: going back computes again from the first frame, because a world of bodies cannot be put back into an earlier state bit by bit.
class LiveRun {
 public:
  /// `take` outlives this. INVALID_ARGUMENT for a take or an effect that cannot be run, or not live: a morph takes whole takes.
  static absl::StatusOr<std::unique_ptr<LiveRun>> Open(const geometry::TrackedTake& take, const nlohmann::json& effect);

  const EffectRun& run() const { return *run_; }
  std::size_t frame() const { return run_->instant(); }
  bool at_end() const { return frame() + 1 >= run_->instants(); }
  /// The effect that holds from here on, canonical.
  const nlohmann::json& effect() const { return effect_; }

  /// To the next frame; not at the end.
  absl::Status Advance(const Cancelled& cancelled);
  /// One field, or with an empty path the whole effect, from this frame on. It replaces the changes that came after this frame before the run went
  /// back. INVALID_ARGUMENT names what is wrong, FAILED_PRECONDITION what can be changed at frame 0 only;
  /// RESOURCE_EXHAUSTED after more changes than a session keeps.
  absl::Status Change(const std::string& path, const nlohmann::json& value);
  /// OUT_OF_RANGE for a frame that has not been computed since the run began. CANCELLED leaves the run somewhere before.
  absl::Status Rewind(std::size_t frame, const Cancelled& cancelled);

 private:
  explicit LiveRun(const geometry::TrackedTake& take) : take_(take) {}
  /// Begins anew with the effect of frame 0.
  absl::Status Restart();
  /// Puts into force what was changed at the present frame.
  absl::Status Replay();

  const geometry::TrackedTake& take_;
  nlohmann::json first_;                                        // the effect at frame 0
  std::map<std::size_t, std::vector<nlohmann::json>> history_;  // what it was changed to at later frames, in that order
  std::size_t history_bytes_ = 0;                               // about, and never less
  nlohmann::json effect_;
  std::unique_ptr<EffectRun> run_;
  std::size_t furthest_ = 0;
};

/// `effect` with one field set. A path names the fields on the way, list elements by number or by their "name"; "pendulum.mass_kg" is short for
/// "objects.pendulum.mass_kg". INVALID_ARGUMENT when there is no such field. The value is not checked.
absl::StatusOr<nlohmann::json> WithField(const nlohmann::json& effect, const std::string& path, const nlohmann::json& value);

/// The field of that path. Errors likewise.
absl::StatusOr<nlohmann::json> FieldOf(const nlohmann::json& effect, const std::string& path);

}  // namespace vorocast::simulation
