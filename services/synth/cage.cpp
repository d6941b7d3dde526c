// SPDX-License-Identifier: AGPL-3.0-or-later
#include "services/synth/cage.h"

#include <cmath>
#include <numbers>

#include "services/synth/choreography.h"
#include "services/synth/implicit_surface.h"
#include "services/synth/palette.h"

namespace vorocast::synth {
namespace {

using geometry::Quat;
using geometry::Vec3;

constexpr double kStep_s = 1.0 / 600;  // divides the usual frame rates
constexpr double kGravity = 9.81;
constexpr double kDamping = 1.1;    // 1/s
constexpr double kCentre_m = 0.36;  // the middle of its mass below the hand

constexpr double kTop_m = -0.16;  // the knob's height: the string is 16 cm long
constexpr double kFloor_m = -0.55;
constexpr double kRadius_m = 0.135;
constexpr double kBar_m = 0.0135;
constexpr int kBars = 8;
constexpr std::int32_t kWork = 0;  // rings and bars are one limb: equal wires do not swell where they meet

Vec3 OnRing(double angle, double radius, double height) { return {radius * std::cos(angle), height, radius * std::sin(angle)}; }

void AddRing(double radius, double height, ImplicitSurface& surface) {
  constexpr int kPieces = 20;
  for (int i = 0; i < kPieces; ++i) {
    const double step = 2 * std::numbers::pi / kPieces;
    surface.Add({OnRing(i * step, radius, height), OnRing((i + 1) * step, radius, height), kBar_m, kBar_m, Vec3::Ones(), 0, 0, kWork});
  }
}

}  // namespace

geometry::TriangleMesh MakeCage(double cell_m) {
  ImplicitSurface surface(0.010, 0.004);
  const double shoulder = kFloor_m + 0.25;  // where the bars begin to bend inwards
  AddRing(kRadius_m, kFloor_m + 0.135, surface);
  for (int i = 0; i < kBars; ++i) {
    const double angle = 2 * std::numbers::pi * i / kBars;
    surface.Add({OnRing(angle, kRadius_m, kFloor_m), OnRing(angle, kRadius_m, shoulder), kBar_m, kBar_m, Vec3::Ones(), 0, 0, kWork});
    constexpr int kArc = 5;
    const auto on_dome = [&](int k) {
      const double a = 0.5 * std::numbers::pi * k / kArc;
      return OnRing(angle, kRadius_m * std::cos(a), shoulder + (kTop_m - 0.03 - shoulder) * std::sin(a));
    };
    for (int k = 0; k < kArc; ++k) surface.Add({on_dome(k), on_dome(k + 1), kBar_m, kBar_m, Vec3::Ones(), 0, 0, kWork});
  }
  // Floor, knob, and the bird on its stand.
  surface.Add({Vec3(0, kFloor_m, 0), Vec3(0, kFloor_m, 0), kRadius_m + 0.02, kRadius_m + 0.02, Vec3(1, 0.12, 1)});
  surface.Add({Vec3(0, kTop_m - 0.02, 0), Vec3(0, kTop_m, 0), 0.030, 0.016});
  surface.Add({Vec3(0, kFloor_m, 0), Vec3(0, kFloor_m + 0.10, 0), 0.020, 0.016});
  surface.Add({Vec3(0, kFloor_m + 0.115, -0.025), Vec3(0, kFloor_m + 0.14, 0.015), 0.028, 0.038});
  surface.Add({Vec3(0, kFloor_m + 0.105, -0.03), Vec3(0, kFloor_m + 0.085, -0.075), 0.020, 0.013});
  surface.Add({Vec3(0, kFloor_m + 0.185, 0.028), Vec3(0, kFloor_m + 0.182, 0.058), 0.027, 0.013});
  geometry::TriangleMesh mesh = ExtractSurface(surface, cell_m);
  for (const Vec3& x : mesh.vertices) mesh.colours.push_back(ColourOf(Part::kCage, x - Vec3(0, kFloor_m, 0)));
  return mesh;
}

SwingingCage::SwingingCage(double seconds)
    : step_(static_cast<std::int64_t>(std::floor(seconds / kStep_s))),
      position_(HoldingHand(PoseAt(seconds)) - Vec3(0, kCentre_m, 0)),
      velocity_(Vec3::Zero()) {}

void SwingingCage::AdvanceTo(double seconds) {
  while (static_cast<double>(step_ + 1) * kStep_s <= seconds + 1e-9) Step();
}

void SwingingCage::Step() {
  const double now = static_cast<double>(++step_) * kStep_s;
  const Vec3 hand = HoldingHand(PoseAt(now));
  const Vec3 hand_velocity = (hand - HoldingHand(PoseAt(now - kStep_s))) / kStep_s;
  const Vec3 before = position_;
  velocity_ += kStep_s * (Vec3(0, -kGravity, 0) - kDamping * (velocity_ - hand_velocity));
  // The string keeps its length.
  position_ = hand + kCentre_m * (before + kStep_s * velocity_ - hand).normalized();
  velocity_ = (position_ - before) / kStep_s;
}

geometry::Rigid3 SwingingCage::WorldFromCage(double seconds) const {
  const Vec3 hand = HoldingHand(PoseAt(seconds));
  const Quat lean = Quat::FromTwoVectors(-Vec3::UnitY(), position_ - hand);
  return {(lean * Quat(Eigen::AngleAxisd(StanceAt(seconds).heading_rad, Vec3::UnitY()))).normalized(), hand};
}

}  // namespace vorocast::synth
