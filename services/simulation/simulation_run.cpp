// SPDX-License-Identifier: AGPL-3.0-or-later
#include "services/simulation/simulation_run.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "services/simulation/release_schedule.h"

namespace vorocast::simulation {
namespace {

using geometry::Box3;
using geometry::CellState;
using geometry::Quat;
using geometry::Rigid3;
using geometry::Vec3;

constexpr double kEarly = 1e-9;                 // times are sums of steps, and sums round
constexpr double kGoneDistance = 100;           // metres from the middle of the first frame
constexpr double kNearPad = 0.005;              // metres, beyond what moves within a step
constexpr int kStepsUntilOut = 8;               // a recalled cell stays in the world so long after the last foreign thing left
constexpr double kUndisturbedDeviation = 1e-6;  // metres, and radians
constexpr double kUndisturbedSpeed = 1e-4;      // metres a second, and radians a second

Box3 BoxAround(const Vec3& centre, double radius) { return {centre - Vec3::Constant(radius), centre + Vec3::Constant(radius)}; }

bool IsFinite(const BodyState& body) {
  return body.position.allFinite() && body.rotation.coeffs().allFinite() && body.velocity.allFinite() && body.angular_velocity.allFinite();
}

}  // namespace

SimulationRun::SimulationRun(const Effect& effect, const TrackedMotion& motion, const Scene& scene, const std::vector<CellShape>& shapes,
                             double first_dt)
    : effect_(effect),
      motion_(motion),
      scene_(scene),
      shapes_(shapes),
      linear_spring_(MakeSpring(effect.recall.stiffness_s2, effect.recall.damping_ratio)),
      angular_spring_(MakeSpring(effect.recall.angular_stiffness_s2, effect.recall.angular_damping_ratio)),
      release_time_(ScheduleRelease(motion, effect.release)),
      previous_dt_(first_dt),
      object_loosened_(scene.bodies.size(), false),
      world_(effect.gravity_m_s2, scene.ground_height, effect.ground.surface) {
  motion.Sample(0, target_);
  motion.Sample(first_dt, next_target_);
  // What the velocities at the start are compared with: the take's own motion, run on backwards.
  previous_target_.resize(target_.size());
  cells_.resize(target_.size());
  Box3 bounds;
  for (std::size_t c = 0; c < target_.size(); ++c) {
    const Quat back = target_[c].rotation * next_target_[c].rotation.conjugate();
    previous_target_[c] = {back * target_[c].rotation, 2 * target_[c].translation - next_target_[c].translation};
    cells_[c].body.position = target_[c].translation;
    cells_[c].body.rotation = target_[c].rotation;
    bounds.extend(target_[c].translation);
  }
  middle_ = bounds.center();
  world_.AddCells(shapes, effect.cells.surface);
  for (const SceneBody& body : scene.bodies) world_.AddObject(body);
}

absl::Status SimulationRun::Step(double dt) {
  motion_.Sample(time_ + dt, next_target_);
  ReleaseDueCells();
  FindWhatMayCollide(dt);
  RecallCells(dt);
  MoveObjects(dt);
  world_.Step(dt);
  RETURN_IF_ERROR(ReadBackCells());
  std::swap(previous_target_, target_);
  std::swap(target_, next_target_);
  previous_dt_ = dt;
  time_ += dt;
  return absl::OkStatus();
}

Vec3 SimulationRun::TargetAngularVelocity(std::size_t c) const {
  return RotationVector(target_[c].rotation * previous_target_[c].rotation.conjugate()) / previous_dt_;
}

void SimulationRun::Release(std::size_t c) {
  Cell& cell = cells_[c];
  if (!cell.disturbed) {
    cell.body.velocity = TargetVelocity(c);
    cell.body.angular_velocity = TargetAngularVelocity(c);
  }
  cell.state = CellState::kReleased;
  world_.Enter(c, World::Role::kReleased, cell.body);
}

void SimulationRun::ReleaseDueCells() {
  for (std::size_t c = 0; c < cells_.size(); ++c) {
    if (cells_[c].state == CellState::kRecalled && release_time_[c] <= time_ + kEarly) Release(c);
  }
}

void SimulationRun::FindWhatMayCollide(double dt) {
  Box3 recalled;
  double recalled_way = 0;  // squared, the longest that a recalled cell goes in this step
  bool foreign = !scene_.bodies.empty();
  for (std::size_t c = 0; c < cells_.size(); ++c) {
    if (cells_[c].state == CellState::kReleased) foreign = true;
    if (cells_[c].state != CellState::kRecalled) continue;
    recalled.extend(cells_[c].body.position);
    recalled_way = std::max(recalled_way, (next_target_[c].translation - target_[c].translation).squaredNorm());
  }
  if (recalled.isEmpty()) return;
  nearness_.Reset(recalled);
  if (foreign) {
    const double pad = kNearPad + std::sqrt(recalled_way);
    for (std::size_t c = 0; c < cells_.size(); ++c) {
      if (cells_[c].state != CellState::kReleased) continue;
      nearness_.Mark(BoxAround(cells_[c].body.position, shapes_[c].radius + pad + dt * cells_[c].body.velocity.norm()));
    }
    for (std::size_t i = 0; i < scene_.bodies.size(); ++i) {
      Box3 box = world_.ObjectBounds(i);
      const double grow = pad + dt * world_.ObjectState(i).velocity.norm();
      nearness_.Mark({box.min() - Vec3::Constant(grow), box.max() + Vec3::Constant(grow)});
    }
  }
  for (std::size_t c = 0; c < cells_.size(); ++c) {
    Cell& cell = cells_[c];
    if (cell.state != CellState::kRecalled) continue;
    const bool inside = world_.Contains(c);
    if (nearness_.IsNear(cell.body.position, shapes_[c].radius)) {
      cell.far_steps = 0;
      if (inside) continue;
      if (!cell.disturbed) {
        cell.body.velocity = TargetVelocity(c);
        cell.body.angular_velocity = TargetAngularVelocity(c);
        cell.disturbed = true;
      }
      world_.Enter(c, World::Role::kRecalled, cell.body);
    } else if (inside && ++cell.far_steps >= kStepsUntilOut) {
      world_.Leave(c);
    }
  }
}

void SimulationRun::RecallCells(double dt) {
  for (std::size_t c = 0; c < cells_.size(); ++c) {
    Cell& cell = cells_[c];
    if (cell.state != CellState::kRecalled) continue;
    if (!cell.disturbed) {
      cell.body.position = next_target_[c].translation;
      cell.body.rotation = next_target_[c].rotation;
      continue;
    }
    const RecallInput input{.body = cell.body,
                            .target = target_[c],
                            .next_target = next_target_[c],
                            .target_velocity = TargetVelocity(c),
                            .target_angular_velocity = TargetAngularVelocity(c)};
    const RecallStep step = Recall(linear_spring_, angular_spring_, input, dt);
    if (effect_.rupture_acceleration_m_s2 && step.acceleration > *effect_.rupture_acceleration_m_s2) {
      Release(c);
      continue;
    }
    if (world_.Contains(c)) {
      world_.SetVelocity(c, {.velocity = step.velocity,
                             .angular_velocity = step.angular_velocity,
                             .resistance = Resistance(linear_spring_, dt),
                             .angular_resistance = Resistance(angular_spring_, dt)});
      continue;
    }
    cell.body.velocity = step.velocity;
    cell.body.angular_velocity = step.angular_velocity;
    Advance(cell.body, dt);
    const Vec3 next_velocity = (next_target_[c].translation - target_[c].translation) / dt;
    const Vec3 turn = RotationVector(cell.body.rotation * next_target_[c].rotation.conjugate());
    const Vec3 next_turn = RotationVector(next_target_[c].rotation * target_[c].rotation.conjugate()) / dt;
    const bool in_place = (cell.body.position - next_target_[c].translation).norm() < kUndisturbedDeviation && turn.norm() < kUndisturbedDeviation;
    const bool at_rest =
        (cell.body.velocity - next_velocity).norm() < kUndisturbedSpeed && (cell.body.angular_velocity - next_turn).norm() < kUndisturbedSpeed;
    if (in_place && at_rest) {
      cell.body.position = next_target_[c].translation;
      cell.body.rotation = next_target_[c].rotation;
      cell.disturbed = false;
    }
  }
}

void SimulationRun::MoveObjects(double dt) {
  for (std::size_t i = 0; i < scene_.bodies.size(); ++i) {
    const SceneBody& body = scene_.bodies[i];
    if (body.motion == SceneBody::Motion::kDriven) world_.Drive(i, body.DrivenPose(time_ + dt));
    if (body.motion == SceneBody::Motion::kLoose && !object_loosened_[i] && body.start_s <= time_ + kEarly) {
      world_.Loosen(i, body.StateWhenLoose(time_));
      object_loosened_[i] = true;
    }
  }
}

absl::Status SimulationRun::ReadBackCells() {
  for (std::size_t c = 0; c < cells_.size(); ++c) {
    if (!world_.Contains(c)) continue;
    Cell& cell = cells_[c];
    if (cell.state == CellState::kReleased && world_.Sleeps(c)) continue;
    cell.body = world_.State(c);
    if (!IsFinite(cell.body)) return absl::InternalError(fmt::format("cell {} at {:.4f} s: its state is no longer finite", c, time_));
    if (cell.state == CellState::kReleased && (cell.body.position - middle_).norm() > kGoneDistance) {
      cell.state = CellState::kGone;
      world_.Leave(c);
    }
  }
  return absl::OkStatus();
}

double SimulationRun::FastestForeign() const {
  double fastest = 0;
  for (std::size_t c = 0; c < cells_.size(); ++c) {
    if (cells_[c].state == CellState::kReleased && !world_.Sleeps(c)) fastest = std::max(fastest, cells_[c].body.velocity.norm());
  }
  for (std::size_t i = 0; i < scene_.bodies.size(); ++i) fastest = std::max(fastest, world_.ObjectState(i).velocity.norm());
  return fastest;
}

void SimulationRun::Record(const geometry::Cells& cells, geometry::SimulatedTake& result) const {
  for (std::size_t c = 0; c < cells_.size(); ++c) {
    const Quat& q = cells_[c].body.rotation;
    const Eigen::Vector4f stored = Eigen::Vector4d(q.w(), q.x(), q.y(), q.z()).cast<float>();
    // The translation belongs to the rotation as it is stored, so that the centroid comes out exactly where it was.
    const Quat rotation = Quat(stored[0], stored[1], stored[2], stored[3]).normalized();
    result.cell_rotation.push_back(stored);
    result.cell_translation.push_back(cells_[c].body.position - rotation * cells.centroid[c]);
    result.cell_state.push_back(cells_[c].state);
  }
  for (std::size_t i = 0; i < scene_.bodies.size(); ++i) {
    const SceneBody& body = scene_.bodies[i];
    Rigid3 world_from_body;
    if (body.motion == SceneBody::Motion::kDriven) {
      world_from_body = body.DrivenPose(time_);
    } else {
      const BodyState state = world_.ObjectState(i);
      world_from_body = {state.rotation, state.position};
    }
    result.object_pose.push_back(world_from_body * body.body_from_object);
  }
}

}  // namespace vorocast::simulation
