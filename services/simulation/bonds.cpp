// SPDX-License-Identifier: AGPL-3.0-or-later
#include "services/simulation/bonds.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace vorocast::simulation {
namespace {

using geometry::Mat3;
using geometry::Vec3;
using State = Bonds::Body::State;

constexpr int kIterations = 10;
constexpr double kPulledGap = 1e-5;  // metres

bool IsLetGo(State state) { return state == State::kReleased || state == State::kAsleep; }

/// What a bond's end does beyond what it rests at: while both cells are recalled only what they do beside their motion counts.
Vec3 EndVelocity(const Bonds::Body& body, const Vec3& arm, bool beside_motion) {
  const Vec3 velocity = body.velocity + body.angular_velocity.cross(arm);
  return beside_motion ? Vec3(velocity - body.target_velocity - body.target_angular_velocity.cross(arm)) : velocity;
}

/// How fast an impulse at the arm moves that point: (1/m) 1 − [r] I⁻¹ [r].
Mat3 Mobility(const Bonds::Body& body, const Vec3& arm) {
  const Mat3 linear = body.inverse_mass * Mat3::Identity();
  return linear + body.inverse_inertia * (arm.squaredNorm() * Mat3::Identity() - arm * arm.transpose());
}

void Push(Bonds::Body& body, const Vec3& arm, const Vec3& impulse) {
  body.velocity += body.inverse_mass * impulse;
  body.angular_velocity += body.inverse_inertia * arm.cross(impulse);
}

}  // namespace

Bonds::Bonds(const BondSettings& settings, const geometry::Cells& cells, const MaskSubject& subject) : settings_(settings) {
  if (settings.between == BondSettings::Between::kNone) return;
  const std::vector<double> weight = MaskWeights(settings.mask, subject);
  partners_.resize(cells.size());
  for (const CellEdge& edge : CellEdges(cells)) {
    const auto a = static_cast<std::size_t>(edge.a);
    const auto b = static_cast<std::size_t>(edge.b);
    const double both = std::min(weight[a], weight[b]);
    if (both <= 0) continue;
    bonds_.push_back({.a = edge.a, .b = edge.b, .on_a = Vec3::Zero(), .on_b = Vec3::Zero(), .length = std::max(edge.distance, 1e-4), .weight = both});
    face_.push_back(edge.face_centre - cells.centroid[a]);
    from_b_.push_back(edge.face_centre - cells.centroid[b]);
    partners_[a].push_back(edge.b);
    partners_[b].push_back(edge.a);
  }
}

void Bonds::Break(Bond& bond) {
  bond.broken = true;
  ++broken_count_;
  std::erase(partners_[static_cast<std::size_t>(bond.a)], bond.b);
  std::erase(partners_[static_cast<std::size_t>(bond.b)], bond.a);
}

/// Where the bond's two ends are. In the tracked motion the two ends do not quite meet: rest is the point between them.
Bonds::Gap Bonds::Measure(const Bond& bond, const std::vector<Body>& bodies) const {
  const Body& a = bodies[static_cast<std::size_t>(bond.a)];
  const Body& b = bodies[static_cast<std::size_t>(bond.b)];
  Vec3 on_a = bond.on_a;
  Vec3 on_b = bond.on_b;
  if (!bond.loose) {
    const auto index = static_cast<std::size_t>(&bond - bonds_.data());
    const Vec3 middle = 0.5 * (a.target * face_[index] + b.target * from_b_[index]);
    on_a = a.target.Inverse() * middle;
    on_b = b.target.Inverse() * middle;
  }
  const Vec3 arm_a = a.rotation * on_a;
  const Vec3 arm_b = b.rotation * on_b;
  return {arm_a, arm_b, b.position + arm_b - a.position - arm_a};
}

std::vector<std::size_t> Bonds::PulledOff(const std::vector<Body>& bodies) const {
  std::vector<std::size_t> pulled;
  if (settings_.between != BondSettings::Between::kAll) return pulled;
  for (const Bond& bond : bonds_) {
    if (bond.broken) continue;
    const auto a = static_cast<std::size_t>(bond.a);
    const auto b = static_cast<std::size_t>(bond.b);
    const bool a_on_target = bodies[a].state == State::kOnTarget;
    const bool b_on_target = bodies[b].state == State::kOnTarget;
    if (a_on_target == b_on_target) continue;
    const State other = a_on_target ? bodies[b].state : bodies[a].state;
    if (other == State::kGone || Measure(bond, bodies).gap.norm() < kPulledGap) continue;
    pulled.push_back(a_on_target ? a : b);
  }
  return pulled;
}

void Bonds::Solve(double time, double dt, std::vector<Body>& bodies) {
  const double stiffness = settings_.stiffness_s2.At(time);
  const double ratio = settings_.damping_ratio.At(time);
  const double limit = settings_.break_stretch ? settings_.break_stretch->At(time) : std::numeric_limits<double>::infinity();
  const bool released_only = settings_.between == BondSettings::Between::kReleased;
  rows_.clear();
  for (std::size_t i = 0; i < bonds_.size(); ++i) {
    Bond& bond = bonds_[i];
    if (bond.broken) continue;
    const Body& a = bodies[static_cast<std::size_t>(bond.a)];
    const Body& b = bodies[static_cast<std::size_t>(bond.b)];
    if (a.state == State::kGone || b.state == State::kGone) {
      Break(bond);
      continue;
    }
    const bool let_go = IsLetGo(a.state) || IsLetGo(b.state);
    if (released_only && !let_go) continue;
    if (let_go && !bond.loose) {
      const Vec3 middle = 0.5 * (a.target * face_[i] + b.target * from_b_[i]);
      bond.on_a = a.target.Inverse() * middle;
      bond.on_b = b.target.Inverse() * middle;
      bond.loose = true;
    }
    if (a.state == State::kAsleep && b.state == State::kAsleep) continue;
    if (a.state == State::kOnTarget && b.state == State::kOnTarget) continue;
    if (a.inverse_mass + b.inverse_mass <= 0) continue;
    const Gap gap = Measure(bond, bodies);
    if (gap.gap.norm() > limit * bond.length) {
      Break(bond);
      continue;
    }
    // Soft constraint: of a spring k and a damper c, over an implicit step (both for a unit of the two cells' reduced mass).
    const double reduced_mass = 1 / (a.inverse_mass + b.inverse_mass);
    const double k = bond.weight * stiffness * reduced_mass;
    const double c = 2 * ratio * std::sqrt(bond.weight * stiffness) * reduced_mass;
    if (k <= 0) continue;
    const double softness = 1 / (dt * (c + dt * k));
    const Mat3 mobility = Mobility(a, gap.arm_a) + Mobility(b, gap.arm_b) + softness * Mat3::Identity();
    rows_.push_back({i, gap.arm_a, gap.arm_b, mobility.inverse(), k / (c + dt * k) * gap.gap, softness});
  }
  for (const Row& row : rows_) {
    const Bond& bond = bonds_[row.bond];
    Push(bodies[static_cast<std::size_t>(bond.a)], row.arm_a, -bond.impulse);
    Push(bodies[static_cast<std::size_t>(bond.b)], row.arm_b, bond.impulse);
  }
  for (int iteration = 0; iteration < kIterations; ++iteration) {
    for (const Row& row : rows_) {
      Bond& bond = bonds_[row.bond];
      Body& a = bodies[static_cast<std::size_t>(bond.a)];
      Body& b = bodies[static_cast<std::size_t>(bond.b)];
      const Vec3 apart = EndVelocity(b, row.arm_b, !bond.loose) - EndVelocity(a, row.arm_a, !bond.loose);
      const Vec3 impulse = -(row.mass * (apart + row.bias + row.softness * bond.impulse));
      bond.impulse += impulse;
      Push(a, row.arm_a, -impulse);
      Push(b, row.arm_b, impulse);
    }
  }
}

}  // namespace vorocast::simulation
