// SPDX-License-Identifier: AGPL-3.0-or-later
#include "services/simulation/pendulum.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

namespace vorocast::simulation {
namespace {

TEST(Pendulum, SmallSwingsHaveTheTextbookPeriod) {
  const PendulumSwing swing(1e-4, 9.81, 2, 5);
  EXPECT_NEAR(swing.period(), 2 * std::numbers::pi * std::sqrt(2 / 9.81), 1e-8);
}

/// θ'' = −g/L sin θ integrated by Runge and Kutta from the moment it is let go.
TEST(Pendulum, FollowsItsEquationOfMotion) {
  const double gravity = 9.81;
  const double length = 2.3;
  const double amplitude = 2.0;
  const PendulumSwing swing(amplitude, gravity, length, 1.5);
  double angle = -amplitude;
  double speed = 0;
  const double h = 1e-4;
  const auto pull = [&](double a) { return -gravity / length * std::sin(a); };
  for (int i = 0; i < 60000; ++i) {
    const double t = swing.start_time() + i * h;
    if (i % 1000 == 0) {
      EXPECT_NEAR(swing.Angle(t), angle, 1e-7);
      EXPECT_NEAR(swing.AngularVelocity(t), speed, 1e-7);
    }
    const double a1 = speed, b1 = pull(angle);
    const double a2 = speed + h / 2 * b1, b2 = pull(angle + h / 2 * a1);
    const double a3 = speed + h / 2 * b2, b3 = pull(angle + h / 2 * a2);
    const double a4 = speed + h * b3, b4 = pull(angle + h * a3);
    angle += h / 6 * (a1 + 2 * a2 + 2 * a3 + a4);
    speed += h / 6 * (b1 + 2 * b2 + 2 * b3 + b4);
  }
}

TEST(Pendulum, HangsStraightAtTheHitAndIsHeldBefore) {
  const PendulumSwing swing(1, 9.81, 1, 3);
  EXPECT_NEAR(swing.Angle(3), 0, 1e-12);
  EXPECT_GT(swing.AngularVelocity(3), 0);
  EXPECT_NEAR(0.5 * std::pow(swing.AngularVelocity(3), 2), 9.81 * (1 - std::cos(1.0)), 1e-9);  // energy
  EXPECT_EQ(swing.Angle(0), -1);
  EXPECT_EQ(swing.AngularVelocity(0), 0);
}

TEST(Pendulum, EquivalentLengthIsThatOfABallOnAnArm) { EXPECT_DOUBLE_EQ(EquivalentLength(2, 0.5), 2 + 0.4 * 0.25 / 2); }

}  // namespace
}  // namespace vorocast::simulation
