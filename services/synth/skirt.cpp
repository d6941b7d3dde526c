// SPDX-License-Identifier: AGPL-3.0-or-later
#include "services/synth/skirt.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "services/synth/choreography.h"
#include "services/synth/palette.h"

namespace vorocast::synth {
namespace {

using geometry::Quat;
using geometry::Vec3;

constexpr double kStep_s = 1.0 / 600;  // divides the usual frame rates
constexpr double kGravity = 9.81;
constexpr double kThickness_m = 0.015;
constexpr double kDrop_m = 0.43;  // from hip line to hem, along the cloth
constexpr double kRestFlare_rad = 0.44;
constexpr double kMostFlare_rad = 1.15;
constexpr double kPendulum_m = 0.30;
constexpr double kDamping = 3.2;       // 1/s
constexpr double kTie = 260;           // 1/s², between neighbouring columns
constexpr double kTravel_s = 0.085;    // from hip line to hem
constexpr double kTwistSpring = 42;    // 1/s²
constexpr double kTwistDamping = 4.5;  // 1/s
constexpr double kLegClearance_m = 0.022;
constexpr std::int32_t kYokeRows = 8;  // from waist to hip line, still on the body
constexpr std::int32_t kDropRows = 34;
constexpr std::int32_t kRows = kYokeRows + kDropRows + 1;
constexpr double kPleats = 10;
constexpr double kPleat_m = 0.017;

// Ellipses about the pelvis at rest: where the waistband sits inside the body, and where the cloth leaves the hips.
const Vec3 kWaistCentre(0, 1.055, -0.002);
const Vec3 kHipCentre(0, 0.935, -0.010);
constexpr double kWaistX_m = 0.127, kWaistZ_m = 0.101;
constexpr double kHipX_m = 0.196, kHipZ_m = 0.150;

double Angle(std::int32_t column) { return 2 * std::numbers::pi * column / kSkirtColumns; }
Vec3 Outward(double angle) { return {std::cos(angle), 0, std::sin(angle)}; }
Vec3 HipAtRest(double angle) { return kHipCentre + Vec3(kHipX_m * std::cos(angle), 0, kHipZ_m * std::sin(angle)); }
Vec3 WaistAtRest(double angle) { return kWaistCentre + Vec3(kWaistX_m * std::cos(angle), 0, kWaistZ_m * std::sin(angle)); }
double HeadingOf(const Pose& pose) {
  const Vec3 forward = pose[kPelvis].rotation * Vec3::UnitZ();
  return std::atan2(forward.x(), forward.z());
}
std::size_t Wrap(std::int32_t column) { return static_cast<std::size_t>((column + kSkirtColumns) % kSkirtColumns); }

/// Balls along a leg from the hip to below the knee.
struct Ball {
  Vec3 centre;
  double radius = 0;
};
std::vector<Ball> LegBalls(const Pose& pose) {
  std::vector<Ball> balls;
  for (const std::int32_t thigh : {kLeftThigh, kRightThigh}) {
    const auto bone = static_cast<std::size_t>(thigh);
    const PerBone<Vec3>& rest = RestJoints();
    for (int i = 1; i <= 8; ++i) {
      const double s = i / 8.0;
      balls.push_back({pose[bone] * (rest[bone] + s * (rest[bone + 1] - rest[bone])), 0.088 + s * (0.053 - 0.088)});
    }
    for (int i = 1; i <= 3; ++i) {
      const double s = i / 8.0;
      balls.push_back({pose[bone + 1] * (rest[bone + 1] + s * (rest[bone + 2] - rest[bone + 1])), 0.055});
    }
  }
  return balls;
}

/// The least flare at which each column clears the legs: the cloth is stretched over them, so what counts is how far they reach outward.
std::array<double, kSkirtColumns> LeastFlare(const Pose& pose) {
  const Quat facing(Eigen::AngleAxisd(HeadingOf(pose), Vec3::UnitY()));
  const std::vector<Ball> balls = LegBalls(pose);
  std::array<double, kSkirtColumns> least{};
  for (std::int32_t column = 0; column < kSkirtColumns; ++column) {
    const Vec3 hip = pose[kPelvis] * HipAtRest(Angle(column));
    const Vec3 outward = facing * Outward(Angle(column));
    double& flare = least[static_cast<std::size_t>(column)];
    for (const Ball& ball : balls) {
      const Vec3 from_hip = ball.centre - hip;
      const double below = -from_hip.y();
      if (below < 0.05 || below > kDrop_m) continue;
      const double out = from_hip.dot(outward) + ball.radius + kLegClearance_m;
      flare = std::max(flare, std::min(std::atan2(out, below), kMostFlare_rad));
    }
  }
  return least;
}

}  // namespace

SwingingSkirt::SwingingSkirt(double seconds) : step_(static_cast<std::int64_t>(std::floor(seconds / kStep_s))) {
  flare_.fill(kRestFlare_rad);
  heading_rad_ = HeadingOf(PoseAt(seconds));
  history_.push_front(flare_);
}

void SwingingSkirt::AdvanceTo(double seconds) {
  while (static_cast<double>(step_ + 1) * kStep_s <= seconds + 1e-9) Step();
}

void SwingingSkirt::Step() {
  const double now = static_cast<double>(++step_) * kStep_s;
  const Pose before = PoseAt(now - kStep_s), pose = PoseAt(now), after = PoseAt(now + kStep_s);
  const double heading = HeadingOf(pose);
  const double heading_rate = std::remainder(HeadingOf(after) - HeadingOf(before), 2 * std::numbers::pi) / (2 * kStep_s);
  const double trail = std::remainder(heading - heading_rad_, 2 * std::numbers::pi);
  heading_rate_ += kStep_s * (kTwistSpring * trail + kTwistDamping * (heading_rate - heading_rate_));
  heading_rad_ += kStep_s * heading_rate_;

  const Vec3 pull = (pose[kPelvis] * kHipCentre * 2 - before[kPelvis] * kHipCentre - after[kPelvis] * kHipCentre) / (kStep_s * kStep_s);
  const Quat facing(Eigen::AngleAxisd(heading, Vec3::UnitY()));
  least_ = LeastFlare(pose);
  Ring acceleration;
  for (std::int32_t column = 0; column < kSkirtColumns; ++column) {
    const auto c = static_cast<std::size_t>(column);
    const double cosine = std::cos(flare_[c]), sine = std::sin(flare_[c]);
    const double flung = heading_rate_ * heading_rate_ * (0.5 * (kHipX_m + kHipZ_m) + 0.6 * kDrop_m * sine);
    const double outward = pull.dot(facing * Outward(Angle(column))) + flung;
    const double hang = (kGravity - pull.y()) * (std::sin(kRestFlare_rad) - sine);  // stiff pleats hold it at its rest flare
    const double tie = flare_[Wrap(column - 1)] + flare_[Wrap(column + 1)] - 2 * flare_[c];
    acceleration[c] = (outward * cosine + hang) / kPendulum_m + kTie * tie - kDamping * rate_[c];
  }
  for (std::size_t c = 0; c < flare_.size(); ++c) {
    rate_[c] += kStep_s * acceleration[c];
    flare_[c] = std::clamp(flare_[c] + kStep_s * rate_[c], 0.10, kMostFlare_rad);
    if (flare_[c] < least_[c]) {
      // Pushed by a leg: it gives way at once and leaves with the leg's speed or less.
      rate_[c] = std::clamp((least_[c] - flare_[c]) / kStep_s * 0.25, 0.0, 2.0);
      flare_[c] = least_[c];
    }
  }
  history_.push_front(flare_);
  if (history_.size() > static_cast<std::size_t>(kTravel_s / kStep_s) + 2) history_.pop_back();
}

SkirtShape SwingingSkirt::Shape() const {
  SkirtShape shape;
  for (std::int32_t knot = 0; knot < kSkirtKnots; ++knot) {
    const double late = kTravel_s * knot / (kSkirtKnots - 1) / kStep_s;
    const Ring& then = history_[std::min(static_cast<std::size_t>(late), history_.size() - 1)];
    Ring ring;
    for (std::size_t c = 0; c < ring.size(); ++c) ring[c] = std::max(then[c], least_[c]);
    for (int round = 0; round < 4; ++round) {
      const Ring sharp = ring;
      for (std::int32_t c = 0; c < kSkirtColumns; ++c) ring[Wrap(c)] = 0.25 * (sharp[Wrap(c - 1)] + 2 * sharp[Wrap(c)] + sharp[Wrap(c + 1)]);
    }
    for (std::size_t c = 0; c < ring.size(); ++c) shape.flare_rad[c][static_cast<std::size_t>(knot)] = static_cast<float>(ring[c]);
  }
  const Pose pose = PoseAt(static_cast<double>(step_) * kStep_s);
  shape.hem_twist_rad = std::clamp(std::remainder(heading_rad_ - HeadingOf(pose), 2 * std::numbers::pi), -0.5, 0.5);
  return shape;
}

geometry::TriangleMesh SkirtTopology() {
  geometry::TriangleMesh mesh;
  // Vertices: all of the outer side row by row from the waist down, then all of the inner one.
  const auto at = [](bool outer, std::int32_t row, std::int32_t column) {
    return ((outer ? 0 : kRows) + row) * kSkirtColumns + static_cast<std::int32_t>(Wrap(column));
  };
  const auto quad = [&mesh](std::int32_t a, std::int32_t b, std::int32_t c, std::int32_t d) {
    mesh.triangles.push_back({a, b, c});
    mesh.triangles.push_back({a, c, d});
  };
  for (std::int32_t column = 0; column < kSkirtColumns; ++column) {
    for (std::int32_t row = 0; row + 1 < kRows; ++row) {
      quad(at(true, row, column), at(true, row, column + 1), at(true, row + 1, column + 1), at(true, row + 1, column));
      quad(at(false, row, column), at(false, row + 1, column), at(false, row + 1, column + 1), at(false, row, column + 1));
    }
    quad(at(true, 0, column), at(false, 0, column), at(false, 0, column + 1), at(true, 0, column + 1));
    quad(at(true, kRows - 1, column), at(true, kRows - 1, column + 1), at(false, kRows - 1, column + 1), at(false, kRows - 1, column));
  }
  for (int side = 0; side < 2; ++side) {
    for (std::int32_t row = 0; row < kRows; ++row) {
      const double above_hem = kDrop_m * (kRows - 1 - row) / kDropRows;
      mesh.colours.insert(mesh.colours.end(), kSkirtColumns, ColourOf(Part::kSkirt, {0, above_hem, 0}));
    }
  }
  return mesh;
}

std::vector<Vec3> PlaceSkirt(const SkirtShape& shape, const Pose& pose) {
  const double heading = HeadingOf(pose);
  std::vector<Vec3> middle(static_cast<std::size_t>(kRows) * kSkirtColumns);
  const auto at = [](std::int32_t row, std::int32_t column) { return static_cast<std::size_t>(row) * kSkirtColumns + Wrap(column); };
  for (std::int32_t column = 0; column < kSkirtColumns; ++column) {
    const double angle = Angle(column);
    const Vec3 waist = pose[kPelvis] * WaistAtRest(angle);
    const Vec3 hip = pose[kPelvis] * HipAtRest(angle);
    // Over the hips the cloth bulges a little, like the body below it.
    for (std::int32_t row = 0; row <= kYokeRows; ++row) {
      const double s = static_cast<double>(row) / kYokeRows;
      const double bulge = s + 0.10 * std::sin(std::numbers::pi * s);
      middle[at(row, column)] = waist + Vec3(bulge * (hip - waist).x(), s * (hip - waist).y(), bulge * (hip - waist).z());
    }
    Vec3 place = hip;
    const auto& flare = shape.flare_rad[static_cast<std::size_t>(column)];
    for (std::int32_t row = 1; row <= kDropRows; ++row) {
      const double s = static_cast<double>(row) / kDropRows;
      const double knot = (s - 0.5 / kDropRows) * (kSkirtKnots - 1);
      const auto k = std::min(static_cast<std::size_t>(knot), static_cast<std::size_t>(kSkirtKnots - 2));
      const double f = knot - static_cast<double>(k);
      const double lean = (1 - f) * static_cast<double>(flare[k]) + f * static_cast<double>(flare[k + 1]);
      const Quat facing(Eigen::AngleAxisd(heading + shape.hem_twist_rad * s * s, Vec3::UnitY()));
      const Vec3 outward = facing * Outward(angle);
      place += kDrop_m / kDropRows * (std::sin(lean) * outward - std::cos(lean) * Vec3::UnitY());
      middle[at(row + kYokeRows, column)] = place + kPleat_m * s * std::cos(kPleats * angle) * outward;
    }
  }
  std::vector<Vec3> solid(2 * middle.size());
  for (std::int32_t row = 0; row < kRows; ++row) {
    for (std::int32_t column = 0; column < kSkirtColumns; ++column) {
      const Vec3 along = middle[at(row, column + 1)] - middle[at(row, column - 1)];
      const Vec3 down = middle[at(std::min(row + 1, kRows - 1), column)] - middle[at(std::max(row - 1, 0), column)];
      const Vec3 normal = along.cross(down).normalized();
      solid[at(row, column)] = middle[at(row, column)] + 0.5 * kThickness_m * normal;
      solid[middle.size() + at(row, column)] = middle[at(row, column)] - 0.5 * kThickness_m * normal;
    }
  }
  return solid;
}

}  // namespace vorocast::synth
