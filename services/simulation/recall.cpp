// SPDX-License-Identifier: AGPL-3.0-or-later
#include "services/simulation/recall.h"

#include <cmath>

namespace vorocast::simulation {

using geometry::Quat;
using geometry::Vec3;

Spring MakeSpring(double stiffness, double damping_ratio) { return {.stiffness = stiffness, .damping = 2 * damping_ratio * std::sqrt(stiffness)}; }

double Resistance(const Spring& spring, double dt) { return 1 + dt * spring.damping + dt * dt * spring.stiffness; }

Vec3 NextDeviationVelocity(const Spring& spring, const Vec3& deviation, const Vec3& velocity, double dt) {
  return (velocity - dt * spring.stiffness * deviation) / Resistance(spring, dt);
}

Vec3 RotationVector(const Quat& rotation) {
  const double sign = rotation.w() < 0 ? -1 : 1;  // q and −q are one rotation: take the shorter way round.
  const Vec3 axis = sign * rotation.vec();
  const double sine = axis.norm();
  if (sine < 1e-12) return 2 * axis;
  return 2 * std::atan2(sine, sign * rotation.w()) / sine * axis;
}

Quat FromRotationVector(const Vec3& vector) {
  const double half = 0.5 * vector.norm();
  const double scale = half < 1e-6 ? 0.5 : 0.5 * std::sin(half) / half;
  const Vec3 axis = scale * vector;
  return Quat(std::cos(half), axis.x(), axis.y(), axis.z()).normalized();
}

RecallStep Recall(const Spring& linear, const Spring& angular, const RecallInput& input, double dt) {
  const Vec3 deviation = input.body.position - input.target.translation;
  const Vec3 deviation_velocity = input.body.velocity - input.target_velocity;
  const Vec3 next_velocity = NextDeviationVelocity(linear, deviation, deviation_velocity + dt * input.acceleration, dt);

  const Vec3 turn = RotationVector(input.body.rotation * input.target.rotation.conjugate());
  const Vec3 turn_velocity = input.body.angular_velocity - input.target_angular_velocity;
  const Vec3 next_turn_velocity = NextDeviationVelocity(angular, turn, turn_velocity, dt);

  return {.velocity = (input.next_target.translation - input.target.translation) / dt + next_velocity,
          .angular_velocity = RotationVector(input.next_target.rotation * input.target.rotation.conjugate()) / dt + next_turn_velocity,
          .acceleration = (linear.stiffness * deviation + linear.damping * deviation_velocity).norm()};
}

void Advance(BodyState& body, double dt) {
  body.position += dt * body.velocity;
  body.rotation = (FromRotationVector(dt * body.angular_velocity) * body.rotation).normalized();
}

}  // namespace vorocast::simulation
