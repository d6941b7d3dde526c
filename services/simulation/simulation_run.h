// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <vector>

#include "services/geometry/simulated_take.h"
#include "services/simulation/cell_shapes.h"
#include "services/simulation/effect_settings.h"
#include "services/simulation/nearness.h"
#include "services/simulation/recall.h"
#include "services/simulation/scene.h"
#include "services/simulation/tracked_motion.h"
#include "services/simulation/world.h"

namespace vorocast::simulation {

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
  double time() const { return time_; }
  /// The fastest speed of anything that is not recalled, metres a second.
  double FastestForeign() const;
  /// Appends what is stored of an instant: poses are world_from_template.
  void Record(const geometry::Cells& cells, geometry::SimulatedTake& result) const;

 private:
  struct Cell {
    BodyState body;  // in the cell's frame (tracked_motion.h)
    geometry::CellState state = geometry::CellState::kRecalled;
    bool disturbed = false;
    int far_steps = 0;  // since something foreign was near
  };

  void ReleaseDueCells();
  void FindWhatMayCollide(double dt);
  void RecallCells(double dt);
  void MoveObjects(double dt);
  absl::Status ReadBackCells();

  void Release(std::size_t c);
  geometry::Vec3 TargetVelocity(std::size_t c) const { return (target_[c].translation - previous_target_[c].translation) / previous_dt_; }
  geometry::Vec3 TargetAngularVelocity(std::size_t c) const;

  const Effect& effect_;
  const TrackedMotion& motion_;
  const Scene& scene_;
  const std::vector<CellShape>& shapes_;
  const Spring linear_spring_;
  const Spring angular_spring_;
  const std::vector<double> release_time_;
  geometry::Vec3 middle_;  // of the first frame: cells too far from it are gone

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
