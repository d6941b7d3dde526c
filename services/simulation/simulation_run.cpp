// SPDX-License-Identifier: AGPL-3.0-or-later
#include "services/simulation/simulation_run.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

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

constexpr double kWakingPush = 1;  // m/s²: fields that change by less leave what lies still alone

}  // namespace

double Duration(const Effect& effect, const TrackedMotion& motion) {
  return std::max(effect.duration_s.value_or(motion.duration_s()), effect.duration_min_s);
}

SimulationRun::SimulationRun(const Effect& effect, const TrackedMotion& motion, const Scene& scene, const std::vector<CellShape>& shapes,
                             double first_dt)
    : effect_(effect),
      motion_(motion),
      scene_(scene),
      shapes_(shapes),
      subject_(motion.model(), motion, scene.take_origin),
      schedule_(ScheduleRelease(motion, subject_, effect.release, Duration(effect, motion))),
      recall_weight_(MaskWeights(effect.recall.mask, subject_)),
      rupture_weight_(MaskWeights(effect.rupture.mask, subject_)),
      fields_(std::in_place, effect.fields, subject_, scene.take_origin),
      distortion_(std::in_place, effect.distortion, subject_, scene.take_origin),
      bonds_(effect.bonds, motion.model().cells, subject_),
      vanishes_(std::ranges::any_of(schedule_.vanish, [](double time) { return std::isfinite(time); })),
      previous_dt_(first_dt),
      object_loosened_(scene.bodies.size(), false),
      world_(effect.gravity_m_s2.At(0), scene.ground_height, effect.ground.surface) {
  motion.Sample(0, target_);
  motion.Sample(first_dt, next_target_);
  distortion_->Apply(0, target_);
  distortion_->Apply(first_dt, next_target_);
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
  world_.LetPartnersOverlap(&bonds_.partners());
}

void SimulationRun::EffectChanged(bool distortion) {
  schedule_ = ScheduleRelease(motion_, subject_, effect_.release, Duration(effect_, motion_));
  vanishes_ = std::ranges::any_of(schedule_.vanish, [](double time) { return std::isfinite(time); });
  recall_weight_ = MaskWeights(effect_.recall.mask, subject_);
  rupture_weight_ = MaskWeights(effect_.rupture.mask, subject_);
  fields_.emplace(effect_.fields, subject_, scene_.take_origin);
  // What slept under the old fields and springs feels the new ones.
  for (Cell& cell : cells_) cell.asleep_push = -1;
  if (distortion) {
    for (std::size_t c = 0; c < cells_.size(); ++c) {
      if (cells_[c].state == CellState::kRecalled) Disturb(c);
    }
  }
  distortion_.emplace(effect_.distortion, subject_, scene_.take_origin);
  if (!distortion) return;
  motion_.Sample(time_ - previous_dt_, previous_target_);
  distortion_->Apply(time_ - previous_dt_, previous_target_);
  motion_.Sample(time_, target_);
  distortion_->Apply(time_, target_);
}

absl::Status SimulationRun::Step(double dt) {
  SetKeyFrames();
  motion_.Sample(time_ + dt, next_target_);
  distortion_->Apply(time_ + dt, next_target_);
  ReleaseDueCells();
  BlowOnReleasedCells(dt);
  FindWhatMayCollide(dt);
  RecallCells(dt);
  MoveObjects(dt);
  world_.Step(dt);
  RETURN_IF_ERROR(ReadBackCells());
  const World::Penetration now = world_.DeepestPenetration();
  deepest_ = {.cells = std::max(deepest_.cells, now.cells),
              .begun = std::max(deepest_.begun, now.begun),
              .objects = std::max(deepest_.objects, now.objects),
              .ground = std::max(deepest_.ground, now.ground)};
  std::swap(previous_target_, target_);
  std::swap(target_, next_target_);
  previous_dt_ = dt;
  time_ += dt;
  return absl::OkStatus();
}

Vec3 SimulationRun::TargetAngularVelocity(std::size_t c) const {
  return RotationVector(target_[c].rotation * previous_target_[c].rotation.conjugate()) / previous_dt_;
}

void SimulationRun::SetKeyFrames() {
  const RecallSettings& recall = effect_.recall;
  linear_spring_ = MakeSpring(recall.stiffness_s2.At(time_), recall.damping_ratio.At(time_));
  angular_spring_ = MakeSpring(recall.angular_stiffness_s2.At(time_), recall.angular_damping_ratio.At(time_));
  gravity_ = effect_.gravity_m_s2.At(time_);
  weight_left_ = -(1 - recall.weight_carried.At(time_)) * gravity_ * Vec3::UnitY();
  world_.SetGravity(gravity_);
  const auto& rupture = effect_.rupture.acceleration_m_s2;
  rupture_m_s2_ = rupture ? rupture->At(time_) : std::numeric_limits<double>::infinity();
  fields_->Advance(time_);
}

/// A mask weakens a cell's spring; its damping ratio stays.
Spring SimulationRun::SpringOf(const Spring& spring, std::size_t c) const {
  const double weight = recall_weight_[c];
  return weight == 1 ? spring : Spring{.stiffness = weight * spring.stiffness, .damping = std::sqrt(weight) * spring.damping};
}

float SimulationRun::ScaleOf(std::size_t c) const {
  const double since = time_ + kEarly - schedule_.vanish[c];
  if (since < 0) return 1;
  return since < schedule_.vanish_s[c] ? static_cast<float>(1 - since / schedule_.vanish_s[c]) : 0;
}

/// From now on its spring is computed.
void SimulationRun::Disturb(std::size_t c) {
  Cell& cell = cells_[c];
  if (cell.disturbed) return;
  cell.body.velocity = TargetVelocity(c);
  cell.body.angular_velocity = TargetAngularVelocity(c);
  cell.disturbed = true;
}

void SimulationRun::Release(std::size_t c) {
  Cell& cell = cells_[c];
  Disturb(c);
  cell.state = CellState::kReleased;
  world_.Enter(c, World::Role::kReleased, cell.body);
}

void SimulationRun::ReleaseDueCells() {
  for (std::size_t c = 0; c < cells_.size(); ++c) {
    if (cells_[c].state == CellState::kRecalled && schedule_.release[c] <= time_ + kEarly) Release(c);
    if (vanishes_ && cells_[c].state != CellState::kGone && ScaleOf(c) == 0) {
      cells_[c].state = CellState::kGone;
      world_.Leave(c);
    }
  }
}

/// Fields reach released cells as a change of velocity. What lies still on the ground or in a pile sleeps on until they change.
void SimulationRun::BlowOnReleasedCells(double dt) {
  if (fields_->empty()) return;
  for (std::size_t c = 0; c < cells_.size(); ++c) {
    Cell& cell = cells_[c];
    if (cell.state != CellState::kReleased) continue;
    const FieldPush push = fields_->At(c, cell.body.position, false);
    const double strength = push.acceleration.norm();
    if (world_.Sleeps(c) && std::abs(strength - cell.asleep_push) < kWakingPush) continue;
    cell.asleep_push = strength;
    if (strength == 0 && push.drag == 0) continue;
    cell.body.velocity = push.After(cell.body.velocity, dt);
    cell.body.angular_velocity /= 1 + dt * push.drag;
    world_.SetReleasedVelocity(c, cell.body.velocity, cell.body.angular_velocity);
  }
}

Vec3 SimulationRun::PushOnRecalled(std::size_t c) const {
  if (fields_->empty()) return weight_left_;
  const FieldPush push = fields_->At(c, cells_[c].body.position, true);
  const Vec3 velocity = cells_[c].disturbed ? cells_[c].body.velocity : TargetVelocity(c);
  return weight_left_ + push.acceleration - push.drag * velocity;
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
      Disturb(c);
      world_.Enter(c, World::Role::kRecalled, cell.body);
    } else if (inside && ++cell.far_steps >= kStepsUntilOut) {
      world_.Leave(c);
    }
  }
}

void SimulationRun::RecallCells(double dt) {
  for (std::size_t c = 0; c < cells_.size(); ++c) {
    if (cells_[c].state == CellState::kRecalled) PlanRecalled(c, dt);
  }
  if (!bonds_.empty()) HoldTogether(dt);
  for (std::size_t c = 0; c < cells_.size(); ++c) {
    if (cells_[c].state == CellState::kRecalled) MoveRecalled(c, dt);
  }
}

/// What its spring and the fields make of a recalled cell; tears it off where that is too much.
void SimulationRun::PlanRecalled(std::size_t c, double dt) {
  Cell& cell = cells_[c];
  const Vec3 push = PushOnRecalled(c);
  if (push != Vec3::Zero()) Disturb(c);
  if (!cell.disturbed) return;
  const RecallInput input{.body = cell.body,
                          .target = target_[c],
                          .next_target = next_target_[c],
                          .target_velocity = TargetVelocity(c),
                          .target_angular_velocity = TargetAngularVelocity(c),
                          .acceleration = push};
  cell.plan = Recall(SpringOf(linear_spring_, c), SpringOf(angular_spring_, c), input, dt);
  if (cell.plan.acceleration > rupture_m_s2_ && rupture_weight_[c] >= 0.5) Release(c);
}

void SimulationRun::MoveRecalled(std::size_t c, double dt) {
  Cell& cell = cells_[c];
  if (!cell.disturbed) {
    cell.body.position = next_target_[c].translation;
    cell.body.rotation = next_target_[c].rotation;
    return;
  }
  if (world_.Contains(c)) {
    world_.SetVelocity(c, {.velocity = cell.plan.velocity,
                           .angular_velocity = cell.plan.angular_velocity,
                           .resistance = Resistance(SpringOf(linear_spring_, c), dt),
                           .angular_resistance = Resistance(SpringOf(angular_spring_, c), dt)});
    return;
  }
  cell.body.velocity = cell.plan.velocity;
  cell.body.angular_velocity = cell.plan.angular_velocity;
  Advance(cell.body, dt);
  if (PushOnRecalled(c) != Vec3::Zero()) return;
  const Vec3 next_velocity = (next_target_[c].translation - target_[c].translation) / dt;
  const Vec3 turn = RotationVector(cell.body.rotation * next_target_[c].rotation.conjugate());
  const Vec3 next_turn = RotationVector(next_target_[c].rotation * target_[c].rotation.conjugate()) / dt;
  const bool in_place = (cell.body.position - next_target_[c].translation).norm() < kUndisturbedDeviation && turn.norm() < kUndisturbedDeviation;
  const bool at_rest =
      (cell.body.velocity - next_velocity).norm() < kUndisturbedSpeed && (cell.body.angular_velocity - next_turn).norm() < kUndisturbedSpeed;
  if (!in_place || !at_rest) return;
  cell.body.position = next_target_[c].translation;
  cell.body.rotation = next_target_[c].rotation;
  cell.disturbed = false;
}

Bonds::Body SimulationRun::BondBody(std::size_t c, double dt) const {
  using State = Bonds::Body::State;
  const Cell& cell = cells_[c];
  if (cell.state == CellState::kGone || ScaleOf(c) < 1) return {.state = State::kGone};
  Bonds::Body body{.position = cell.body.position,
                   .rotation = cell.body.rotation,
                   .velocity = (next_target_[c].translation - target_[c].translation) / dt,
                   .angular_velocity = RotationVector(next_target_[c].rotation * target_[c].rotation.conjugate()) / dt,
                   .target = target_[c]};
  body.target_velocity = body.velocity;
  body.target_angular_velocity = body.angular_velocity;
  if (cell.state == CellState::kRecalled && !cell.disturbed) return body;
  double resistance = 1;
  double angular_resistance = 1;
  if (cell.state == CellState::kReleased) {
    body.state = world_.Sleeps(c) ? State::kAsleep : State::kReleased;
    const Vec3 falling = body.state == State::kReleased ? Vec3(-dt * gravity_ * Vec3::UnitY()) : Vec3(Vec3::Zero());
    body.velocity = cell.body.velocity + falling;  // as Bullet is going to have it
    body.angular_velocity = cell.body.angular_velocity;
  } else {
    body.state = State::kRecalled;
    body.velocity = cell.plan.velocity;
    body.angular_velocity = cell.plan.angular_velocity;
    if (effect_.bonds.between == BondSettings::Between::kReleased) return body;
    resistance = Resistance(SpringOf(linear_spring_, c), dt);
    angular_resistance = Resistance(SpringOf(angular_spring_, c), dt);
  }
  body.inverse_mass = 1 / (resistance * shapes_[c].mass);
  body.inverse_inertia = 3 / (angular_resistance * shapes_[c].inertia.sum());
  return body;
}

/// Bonds change the velocities that recalled cells have planned and released ones have.
void SimulationRun::HoldTogether(double dt) {
  using State = Bonds::Body::State;
  constexpr double kWakingSpeed = 0.02;  // m/s: what a bond must do to a cell that lies still
  const std::size_t n = cells_.size();
  bond_bodies_.resize(n);
  for (std::size_t c = 0; c < n; ++c) bond_bodies_[c] = BondBody(c, dt);
  for (const std::size_t c : bonds_.PulledOff(bond_bodies_)) {
    Disturb(c);
    PlanRecalled(c, dt);
    bond_bodies_[c] = BondBody(c, dt);
  }
  bonds_.Solve(time_, dt, bond_bodies_);
  for (std::size_t c = 0; c < n; ++c) {
    const Bonds::Body& body = bond_bodies_[c];
    Cell& cell = cells_[c];
    if (body.state == State::kRecalled) {
      cell.plan.velocity = body.velocity;
      cell.plan.angular_velocity = body.angular_velocity;
    }
    if (body.state == State::kAsleep && body.velocity.norm() < kWakingSpeed) continue;
    if (body.state != State::kReleased && body.state != State::kAsleep) continue;
    cell.body.velocity = body.velocity + (body.state == State::kReleased ? Vec3(dt * gravity_ * Vec3::UnitY()) : Vec3(Vec3::Zero()));
    cell.body.angular_velocity = body.angular_velocity;
    world_.SetReleasedVelocity(c, cell.body.velocity, cell.body.angular_velocity);
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
    if (vanishes_) result.cell_scale.push_back(ScaleOf(c));
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
