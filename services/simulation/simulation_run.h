// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <optional>
#include <vector>

#include "services/geometry/simulated_take.h"
#include "services/simulation/bonds.h"
#include "services/simulation/cell_shapes.h"
#include "services/simulation/distortion.h"
#include "services/simulation/effect_settings.h"
#include "services/simulation/force_fields.h"
#include "services/simulation/nearness.h"
#include "services/simulation/recall.h"
#include "services/simulation/release_schedule.h"
#include "services/simulation/scene.h"
#include "services/simulation/tracked_motion.h"
#include "services/simulation/world.h"

namespace vorocast::simulation {

/// How long an effect runs on a take, seconds.
double Duration(const Effect& effect, const TrackedMotion& motion);

/// The state of one effect running on one take, advanced step by step.
///
/// A recalled cell is undisturbed (exactly on its tracked pose), disturbed (its spring pulls it back, computed here), or in the world of
/// bodies that may collide: only while something foreign (a released cell or a scene object) is near enough to touch it within a step.
/// Where it is makes no difference to its motion, only to its cost.
class SimulationRun {
 public:
  /// The arguments outlive this.
  SimulationRun(const Effect& effect, const TrackedMotion& motion, const Scene& scene, const std::vector<CellShape>& shapes, double first_dt);

  /// From time() to time() + dt. INTERNAL, with the cell, when a body's state is no longer finite.
  absl::Status Step(double dt);
  /// To be called after the effect was changed in its place: from the next step on it holds. Cells that were let go stay so. What the scene is built
  /// of and which cells hold each other must be as before. `distortion`: whether that differs; cells then go to their new places by their springs.
  void EffectChanged(bool distortion);
  double time() const { return time_; }
  /// The fastest speed of anything that is not recalled, metres a second.
  double FastestForeign() const;
  /// Appends what is stored of an instant: poses are world_from_template.
  void Record(const geometry::Cells& cells, geometry::SimulatedTake& result) const;
  const MaskSubject& subject() const { return subject_; }
  const Bonds& bonds() const { return bonds_; }
  /// Since the run began.
  const World::Penetration& deepest_penetration() const { return deepest_; }

 private:
  struct Cell {
    BodyState body;  // in the cell's frame (tracked_motion.h)
    geometry::CellState state = geometry::CellState::kRecalled;
    bool disturbed = false;
    int far_steps = 0;       // since something foreign was near
    RecallStep plan;         // of a disturbed recalled cell, for the step at hand
    double asleep_push = 0;  // m/s², what the fields did to a released cell when it last lay still
  };

  void SetKeyFrames();
  void ReleaseDueCells();
  void BlowOnReleasedCells(double dt);
  void FindWhatMayCollide(double dt);
  void RecallCells(double dt);
  void PlanRecalled(std::size_t c, double dt);
  void MoveRecalled(std::size_t c, double dt);
  void HoldTogether(double dt);
  Bonds::Body BondBody(std::size_t c, double dt) const;
  void MoveObjects(double dt);
  absl::Status ReadBackCells();

  void Release(std::size_t c);
  void Disturb(std::size_t c);
  geometry::Vec3 PushOnRecalled(std::size_t c) const;
  Spring SpringOf(const Spring& spring, std::size_t c) const;
  float ScaleOf(std::size_t c) const;
  geometry::Vec3 TargetVelocity(std::size_t c) const { return (target_[c].translation - previous_target_[c].translation) / previous_dt_; }
  geometry::Vec3 TargetAngularVelocity(std::size_t c) const;

  const Effect& effect_;
  const TrackedMotion& motion_;
  const Scene& scene_;
  const std::vector<CellShape>& shapes_;
  const MaskSubject subject_;
  ReleaseSchedule schedule_;
  std::vector<double> recall_weight_;
  std::vector<double> rupture_weight_;
  std::optional<ForceFields> fields_;     // never empty; they refer to the effect, and are made anew when it changes
  std::optional<Distortion> distortion_;  // likewise
  Bonds bonds_;
  std::vector<Bonds::Body> bond_bodies_;  // of the step at hand; a member only to keep its memory
  bool vanishes_;                         // whether any cell ever does
  geometry::Vec3 middle_;                 // of the first frame: cells too far from it are gone

  // What key frames say for the step at hand.
  Spring linear_spring_;
  Spring angular_spring_;
  double gravity_ = 0;
  geometry::Vec3 weight_left_ = geometry::Vec3::Zero();  // what of a recalled cell's weight its spring has to carry, m/s²
  double rupture_m_s2_ = 0;

  World::Penetration deepest_;
  double time_ = 0;
  double previous_dt_;
  std::vector<geometry::Rigid3> previous_target_;
  std::vector<geometry::Rigid3> target_;
  std::vector<geometry::Rigid3> next_target_;
  std::vector<Cell> cells_;
  std::vector<bool> object_loosened_;
  Nearness nearness_;
  World world_;
};

}  // namespace vorocast::simulation
