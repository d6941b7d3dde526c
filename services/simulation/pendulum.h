// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

namespace vorocast::simulation {

/// The swing of a frictionless pendulum, in closed form. The angle is measured from hanging straight and passes 0 upwards at `hit_time`.
/// Before it is let go, a quarter period earlier, it is held at −amplitude.
class PendulumSwing {
 public:
  /// amplitude in (0, π) radians; gravity above 0, m/s²; length of the mathematical pendulum that swings alike, metres.
  PendulumSwing(double amplitude, double gravity, double length, double hit_time);

  double Angle(double time) const;            // radians
  double AngularVelocity(double time) const;  // radians a second
  double start_time() const { return start_time_; }
  double period() const { return period_; }

 private:
  double amplitude_;
  double modulus_;    // k = sin(amplitude / 2)
  double frequency_;  // of small swings, radians a second
  double period_;
  double hit_time_;
  double start_time_;
};

/// The length of the mathematical pendulum that swings like a ball of uniform density on a massless arm: (L² + 2/5 r²) / L.
double EquivalentLength(double arm, double ball_radius);

}  // namespace vorocast::simulation
