// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include "services/geometry/rigid3.h"

/// The recall force (paper, section 5.2): F = k (xa − x) + λ d/dt (xa − x), with the damping's sign as physics needs it (the paper prints
/// −λ, which feeds energy in), and an angular spring of the same kind. Everything is for a unit of mass or inertia.
///
/// The spring is written in the deviation from the tracked pose, e = x − xa and w = v − va. Gravity and the tracked motion's own
/// acceleration are fed forward: an undisturbed cell follows its tracked motion exactly, at rest or not, and what the spring pulls is only
/// what disturbs the cell. That is also the force that rupture looks at.
namespace vorocast::simulation {

/// A cell's body: centroid and principal axes, metres, metres a second, radians a second.
struct BodyState {
  geometry::Vec3 position = geometry::Vec3::Zero();
  geometry::Quat rotation = geometry::Quat::Identity();
  geometry::Vec3 velocity = geometry::Vec3::Zero();
  geometry::Vec3 angular_velocity = geometry::Vec3::Zero();
};

struct Spring {
  double stiffness = 0;  // 1/s²
  double damping = 0;    // 1/s
};

/// λ = 2 ζ √k: critically damped for ζ = 1.
Spring MakeSpring(double stiffness, double damping_ratio);

/// The deviation's velocity after one implicit Euler step: w' = w + dt (−k (e + dt w') − λ w'). Stable for every dt, k and λ.
geometry::Vec3 NextDeviationVelocity(const Spring& spring, const geometry::Vec3& deviation, const geometry::Vec3& velocity, double dt);

/// The rotation vector (axis times angle in [0, π]) of a unit quaternion, and back.
geometry::Vec3 RotationVector(const geometry::Quat& rotation);
geometry::Quat FromRotationVector(const geometry::Vec3& vector);

/// How much harder than its mass a body on an implicit spring is to push within a step: w' = w'_free + impulse / (resistance × mass).
double Resistance(const Spring& spring, double dt);

struct RecallStep {
  geometry::Vec3 velocity;  // that carries the body through the coming step if nothing touches it
  geometry::Vec3 angular_velocity;
  double acceleration = 0;  // of the recall force as the body is now, |k e + λ w|, metres a second squared
};

/// The velocities of a recalled body for a step of dt in which its tracked pose goes from `target` to `next_target`; `target_velocity`
/// and `target_angular_velocity` are those of the step before (what the body's own velocities are compared with).
struct RecallInput {
  BodyState body;
  geometry::Rigid3 target;
  geometry::Rigid3 next_target;
  geometry::Vec3 target_velocity = geometry::Vec3::Zero();
  geometry::Vec3 target_angular_velocity = geometry::Vec3::Zero();
  geometry::Vec3 acceleration = geometry::Vec3::Zero();  // of everything else that acts on the body
};
RecallStep Recall(const Spring& linear, const Spring& angular, const RecallInput& input, double dt);

/// Moves a body that touches nothing by its velocities.
void Advance(BodyState& body, double dt);

}  // namespace vorocast::simulation
