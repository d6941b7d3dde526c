// SPDX-License-Identifier: AGPL-3.0-or-later
#include "services/simulation/recall.h"

#include <gtest/gtest.h>

#include <cmath>

namespace vorocast::simulation {
namespace {

using geometry::Quat;
using geometry::Rigid3;
using geometry::Vec3;

RecallStep StepTo(BodyState& body, const Spring& spring, const Rigid3& target, double dt) {
  const RecallStep step = Recall(spring, spring, {.body = body, .target = target, .next_target = target}, dt);
  body.velocity = step.velocity;
  body.angular_velocity = step.angular_velocity;
  Advance(body, dt);
  return step;
}

TEST(Spring, CriticalDampingIsTwoRootK) {
  EXPECT_DOUBLE_EQ(MakeSpring(1000, 1).damping, 2 * std::sqrt(1000.0));
  EXPECT_DOUBLE_EQ(MakeSpring(1000, 0.25).damping, 0.5 * std::sqrt(1000.0));
}

/// x(t) = x0 (1 + ω t) e^(−ω t), ω = √k, for a critically damped spring let go at rest.
TEST(Recall, CriticallyDampedResponseConvergesToTheAnalyticOne) {
  const double omega = std::sqrt(1000.0);
  double last_error = 1;
  for (const double dt : {1e-3, 1e-4, 1e-5}) {
    BodyState body;
    body.position = Vec3(0.1, 0, 0);
    double error = 0;
    for (int i = 1; i * dt <= 0.2; ++i) {
      StepTo(body, MakeSpring(1000, 1), {}, dt);
      const double t = i * dt;
      error = std::max(error, std::abs(body.position.x() - 0.1 * (1 + omega * t) * std::exp(-omega * t)));
    }
    EXPECT_LT(error, 0.12 * last_error);  // first order: ten times smaller steps, ten times smaller error
    last_error = error;
  }
  EXPECT_LT(last_error, 1e-5);
}

TEST(Recall, AngularSpringIsTheSameInItsAngle) {
  const double omega = std::sqrt(1000.0);
  const double dt = 1e-5;
  BodyState body;
  body.rotation = FromRotationVector(Vec3(0, 0.5, 0));
  for (int i = 0; i < 10000; ++i) StepTo(body, MakeSpring(1000, 1), {}, dt);
  const double t = 0.1;
  EXPECT_NEAR(RotationVector(body.rotation).y(), 0.5 * (1 + omega * t) * std::exp(-omega * t), 1e-4);
}

/// The paper's printed sign pumps energy in; this one takes it out, at every step and whatever the step.
TEST(Recall, EnergyNeverGrows) {
  for (const double ratio : {0.0, 0.1, 1.0, 5.0}) {
    for (const double dt : {1e-3, 1.0 / 240, 1.0 / 25, 1.0}) {
      const Spring spring = MakeSpring(1000, ratio);
      BodyState body;
      body.position = Vec3(0.05, -0.02, 0.01);
      body.velocity = Vec3(-3, 1, 2);
      double energy = 0.5 * body.velocity.squaredNorm() + 0.5 * spring.stiffness * body.position.squaredNorm();
      for (int i = 0; i < 200; ++i) {
        StepTo(body, spring, {}, dt);
        const double next = 0.5 * body.velocity.squaredNorm() + 0.5 * spring.stiffness * body.position.squaredNorm();
        EXPECT_LE(next, energy * (1 + 1e-12));
        energy = next;
      }
    }
  }
}

TEST(Recall, DampingOpposesTheRelativeVelocity) {
  const Spring damper{.stiffness = 0, .damping = 10};
  BodyState body;
  body.velocity = Vec3(1, 0, 0);
  const RecallStep step = StepTo(body, damper, {}, 0.01);
  EXPECT_NEAR(step.velocity.x(), 1 / 1.1, 1e-12);
  EXPECT_NEAR(step.acceleration, 10, 1e-9);
}

TEST(Recall, AnUndisturbedBodyFollowsExactlyAndFeelsNoForce) {
  const auto pose = [](double t) { return Rigid3{Quat(Eigen::AngleAxisd(3 * t * t, Vec3(1, 2, 3).normalized())), Vec3(t * t, std::sin(5 * t), -t)}; };
  const double dt = 1.0 / 240;
  BodyState body;
  body.position = pose(0).translation;
  body.rotation = pose(0).rotation;
  body.velocity = (pose(0).translation - pose(-dt).translation) / dt;
  body.angular_velocity = RotationVector(pose(0).rotation * pose(-dt).rotation.conjugate()) / dt;
  for (int i = 0; i < 240; ++i) {
    const RecallInput input{.body = body,
                            .target = pose(i * dt),
                            .next_target = pose((i + 1) * dt),
                            .target_velocity = (pose(i * dt).translation - pose((i - 1) * dt).translation) / dt,
                            .target_angular_velocity = RotationVector(pose(i * dt).rotation * pose((i - 1) * dt).rotation.conjugate()) / dt};
    const RecallStep step = Recall(MakeSpring(1000, 1), MakeSpring(1000, 1), input, dt);
    EXPECT_LT(step.acceleration, 1e-9);
    body.velocity = step.velocity;
    body.angular_velocity = step.angular_velocity;
    Advance(body, dt);
    EXPECT_LT((body.position - pose((i + 1) * dt).translation).norm(), 1e-12);
    EXPECT_LT(body.rotation.angularDistance(pose((i + 1) * dt).rotation), 1e-7);
  }
}

TEST(RotationVector, IsTheInverseOfItsExponential) {
  for (const Vec3& vector : {Vec3(0, 0, 0), Vec3(1e-9, 0, 0), Vec3(0.3, -0.2, 0.9), Vec3(0, 3.1, 0)}) {
    EXPECT_LT((RotationVector(FromRotationVector(vector)) - vector).norm(), 1e-9);
    const Quat q = FromRotationVector(vector);
    EXPECT_LT((RotationVector(Quat(-q.w(), -q.x(), -q.y(), -q.z())) - vector).norm(), 1e-9);
  }
}

}  // namespace
}  // namespace vorocast::simulation
