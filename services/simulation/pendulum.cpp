// SPDX-License-Identifier: AGPL-3.0-or-later
#include "services/simulation/pendulum.h"

#include <array>
#include <cmath>

namespace vorocast::simulation {
namespace {

struct Jacobi {
  double sn, cn;
};

/// Jacobi's elliptic functions of argument u and modulus k in [0, 1), by the arithmetic-geometric mean (Abramowitz and Stegun, 16.4).
Jacobi EllipticSineCosine(double u, double k) {
  constexpr int kLevels = 12;  // converges quadratically
  std::array<double, kLevels + 1> a{1};
  std::array<double, kLevels + 1> c{k};
  double b = std::sqrt(1 - k * k);
  for (int i = 0; i < kLevels; ++i) {
    a[i + 1] = (a[i] + b) / 2;
    c[i + 1] = (a[i] - b) / 2;
    b = std::sqrt(a[i] * b);
  }
  double phi = std::ldexp(a[kLevels] * u, kLevels);
  for (int i = kLevels; i > 0; --i) phi = (phi + std::asin(c[i] / a[i] * std::sin(phi))) / 2;
  return {std::sin(phi), std::cos(phi)};
}

}  // namespace

PendulumSwing::PendulumSwing(double amplitude, double gravity, double length, double hit_time)
    : amplitude_(amplitude),
      modulus_(std::sin(amplitude / 2)),
      frequency_(std::sqrt(gravity / length)),
      period_(4 * std::comp_ellint_1(modulus_) / frequency_),
      hit_time_(hit_time),
      start_time_(hit_time - period_ / 4) {}

// sin(θ/2) = k sn(ω t, k) and θ' = 2 k ω cn(ω t, k).
double PendulumSwing::Angle(double time) const {
  if (time <= start_time_) return -amplitude_;
  const double since = std::remainder(time - hit_time_, period_);
  return 2 * std::asin(modulus_ * EllipticSineCosine(frequency_ * since, modulus_).sn);
}

double PendulumSwing::AngularVelocity(double time) const {
  if (time <= start_time_) return 0;
  const double since = std::remainder(time - hit_time_, period_);
  return 2 * modulus_ * frequency_ * EllipticSineCosine(frequency_ * since, modulus_).cn;
}

double EquivalentLength(double arm, double ball_radius) { return (arm * arm + 0.4 * ball_radius * ball_radius) / arm; }

}  // namespace vorocast::simulation
