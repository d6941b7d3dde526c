// SPDX-License-Identifier: AGPL-3.0-or-later
#include "services/synth/choreography.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace vorocast::synth {
namespace {

using geometry::Mat3;
using geometry::Quat;
using geometry::Rigid3;
using geometry::Vec3;

constexpr double kTurn = 2 * std::numbers::pi;
constexpr double kDegree = std::numbers::pi / 180;
constexpr double kStepCycle_s = 1.3;  // left and right step
constexpr double kSwingShare = 0.44;  // of the cycle that one foot is in the air
constexpr double kHalfStance_m = 0.085;

/// sin of a motion that repeats every `period_s`, `phase` in turns.
double Wave(double seconds, double period_s, double phase = 0) { return std::sin(kTurn * (seconds / period_s + phase)); }

Quat About(const Vec3& axis, double angle) { return Quat(Eigen::AngleAxisd(angle, axis.normalized())); }

Quat Heading(double radians) { return About(Vec3::UnitY(), radians); }

/// From 0 to 1 with no jerk at either end.
double Ease(double u) {
  u = std::clamp(u, 0.0, 1.0);
  return u * u * u * (10 + u * (6 * u - 15));
}

/// A rotation about a bone's own joint, on top of what its parent does.
Rigid3 Joint(const Pose& pose, std::int32_t bone, const Quat& turn) {
  const Rigid3& parent = pose[static_cast<std::size_t>(ParentOf(bone))];
  const Vec3& joint = RestJoints()[static_cast<std::size_t>(bone)];
  return parent * Rigid3{turn, joint - turn * joint};
}

/// A bone whose joint and rotation are known in the world.
Rigid3 Placed(const Vec3& joint_in_world, const Quat& world_from_rest, const Vec3& joint_at_rest) {
  return {world_from_rest, joint_in_world - world_from_rest * joint_at_rest};
}

/// The rotation that takes one pair of (direction, side) to another; sides need not be square to the directions.
Quat Align(const Vec3& from, const Vec3& from_side, const Vec3& to, const Vec3& to_side) {
  const auto frame = [](const Vec3& direction, const Vec3& side) {
    Mat3 columns;
    columns.col(0) = direction.normalized();
    columns.col(2) = columns.col(0).cross(side).normalized();
    columns.col(1) = columns.col(2).cross(columns.col(0));
    return columns;
  };
  return Quat(Mat3(frame(to, to_side) * frame(from, from_side).transpose())).normalized();
}

struct Foot {
  Vec3 ankle;
  Quat rotation;
};

/// Where a planted foot stands during its `step`-th stance: under the hips as they will be in the middle of it.
std::pair<Vec3, double> Footprint(bool left, double step) {
  const Stance stance = StanceAt((step + (left ? 0.75 : 1.25)) * kStepCycle_s);
  const double side = left ? 1 : -1;
  return {stance.on_floor + Heading(stance.heading_rad) * Vec3(side * kHalfStance_m, 0, 0), stance.heading_rad + side * 0.12};
}

Foot FootAt(bool left, double seconds) {
  // The left foot swings around a quarter of the cycle, the right one around three quarters.
  const double cycle = seconds / kStepCycle_s - (left ? 0.25 : 0.75) + kSwingShare / 2;
  const double step = std::floor(cycle);
  const double u = std::min((cycle - step) / kSwingShare, 1.0);
  const auto [from, from_heading] = Footprint(left, step - 1);
  const auto [to, to_heading] = Footprint(left, step);
  const double heading = from_heading + Ease(u) * (to_heading - from_heading);
  const double air = std::pow(std::sin(std::numbers::pi * u), 2);
  const Quat facing = Heading(heading);
  const Vec3& rest_ankle = RestJoints()[left ? kLeftFoot : kRightFoot];
  const double kick = 0.095 * (0.6 + 0.4 * Wave(seconds, 2 * kStepCycle_s));
  const Vec3 ankle = from + Ease(u) * (to - from) + Vec3(0, rest_ankle.y() + 0.085 * air, 0) + facing * Vec3(0, 0, kick * air);
  return {ankle, facing * About(Vec3::UnitX(), 0.34 * air)};
}

void PoseLeg(bool left, double seconds, Pose& pose) {
  const std::size_t thigh = left ? kLeftThigh : kRightThigh;
  const PerBone<Vec3>& rest = RestJoints();
  const Foot foot = FootAt(left, seconds);
  const Vec3 hip = pose[kPelvis] * rest[thigh];
  const Vec3 reach = foot.ankle - hip;
  const double length = std::min(reach.norm(), 0.999 * (kThigh_m + kShin_m));
  const Vec3 down = reach.normalized();
  const Vec3 knee_forward = (pose[kPelvis].rotation * Vec3(left ? 0.10 : -0.10, 0, 1) + foot.rotation * Vec3::UnitZ()).normalized();
  const Vec3 bend = (knee_forward - down * down.dot(knee_forward)).normalized();
  const double cosine = (kThigh_m * kThigh_m + length * length - kShin_m * kShin_m) / (2 * kThigh_m * length);
  const double angle = std::acos(std::clamp(cosine, -1.0, 1.0));
  const Vec3 knee = hip + kThigh_m * (std::cos(angle) * down + std::sin(angle) * bend);
  const Vec3 ankle = hip + length * down;
  const Vec3 straight = RestLegDirection(left);
  pose[thigh] = Placed(hip, Align(straight, Vec3::UnitZ(), knee - hip, bend), rest[thigh]);
  pose[thigh + 1] = Placed(knee, Align(straight, Vec3::UnitZ(), ankle - knee, bend), rest[thigh + 1]);
  pose[thigh + 2] = Placed(ankle, foot.rotation, rest[thigh + 2]);
}

/// An arm by the direction of its upper part seen from the chest, the bend of the elbow and how far that bend is rolled about the arm.
struct ArmAngles {
  double elevation = 0;  // above the horizontal
  double forward = 0;    // from straight out to the side
  double elbow = 0;
  double roll = 0;  // 0 bends the forearm forward, positive upward
  double wrist = 0;
};

void PoseArm(bool left, const ArmAngles& arm, Pose& pose) {
  const std::int32_t collar = left ? kLeftCollar : kRightCollar;
  const double side = left ? 1 : -1;
  const auto bone = static_cast<std::size_t>(collar);
  const double shrug = 0.32 * std::max(0.0, arm.elevation + 25 * kDegree);
  pose[bone] = Joint(pose, collar, About(Vec3::UnitZ(), side * shrug));
  const Vec3 rest = RestArmDirection(left);
  const double elevation = arm.elevation - shrug;
  const Vec3 direction(side * std::cos(elevation) * std::cos(arm.forward), std::sin(elevation), std::cos(elevation) * std::sin(arm.forward));
  const Quat raise = About(direction, -side * arm.roll) * Quat::FromTwoVectors(rest, direction);
  pose[bone + 1] = Joint(pose, collar + 1, raise);
  const Vec3 hinge = rest.cross(Vec3::UnitZ());
  pose[bone + 2] = Joint(pose, collar + 2, About(hinge, arm.elbow));
  pose[bone + 3] = Joint(pose, collar + 3, About(hinge, arm.wrist));
}

void PoseTrunk(double seconds, Pose& pose) {
  const Stance stance = StanceAt(seconds);
  const double step = kTurn * seconds / kStepCycle_s;
  // Weight goes over the standing foot while the other one swings, and the free hip sinks a little.
  const Vec3 sway(-0.036 * std::sin(step), -0.032 - 0.011 * std::cos(2 * step), 0.012 * std::sin(2 * step));
  const Quat facing = Heading(stance.heading_rad);
  const Quat tilt = About(Vec3::UnitZ(), -0.065 * std::sin(step)) * About(Vec3::UnitY(), 0.11 * std::sin(step + 0.4)) *
                    About(Vec3::UnitX(), 0.03 + 0.02 * std::cos(2 * step));
  const Vec3& joint = RestJoints()[kPelvis];
  pose[kPelvis] = Placed(stance.on_floor + facing * (sway + joint), facing * tilt, joint);

  const double bend = 0.07 * std::sin(step) + 0.07 * Wave(seconds, 4.2, 0.0);
  const double twist = -0.09 * std::sin(step + 0.4) + 0.10 * Wave(seconds, 4.2, -0.1);
  const Quat half = About(Vec3::UnitZ(), bend / 2) * About(Vec3::UnitY(), twist / 2) * About(Vec3::UnitX(), -0.02 + 0.03 * Wave(seconds, 3.3, 0.2));
  pose[kWaist] = Joint(pose, kWaist, half);
  pose[kChest] = Joint(pose, kChest, half);
  const Quat look = About(Vec3::UnitY(), 0.17 * Wave(seconds, 4.2, -0.2)) * About(Vec3::UnitX(), -0.08 * Wave(seconds, 4.2, -0.25)) *
                    About(Vec3::UnitZ(), -bend / 3);
  pose[kNeck] = Joint(pose, kNeck, look);
  pose[kSkull] = Joint(pose, kSkull, look);
}

}  // namespace

Stance StanceAt(double seconds) {
  const double around = kTurn * seconds / 9.0;
  return {{0.16 * std::sin(around), 0, 0.16 * std::cos(around)}, 0.40 * seconds + 0.36 * Wave(seconds, 5.2)};
}

Pose PoseAt(double seconds) {
  Pose pose;
  PoseTrunk(seconds, pose);
  const double sweep = Wave(seconds, 4.2, -0.25);
  PoseArm(true,
          {.elevation = (8 + 45 * sweep) * kDegree,
           .forward = (22 + 24 * Wave(seconds, 4.2, -0.05)) * kDegree,
           .elbow = (34 - 16 * sweep) * kDegree,
           .roll = (20 + 25 * sweep) * kDegree,
           .wrist = 14 * Wave(seconds, 4.2, -0.4) * kDegree},
          pose);
  PoseArm(false,
          {.elevation = (4 + 9 * Wave(seconds, 3.1, 0.1)) * kDegree,
           .forward = (18 + 10 * Wave(seconds, 4.3, 0.3)) * kDegree,
           .elbow = (20 + 8 * Wave(seconds, 2.6, 0.5)) * kDegree,
           .roll = 25 * kDegree,
           .wrist = 6 * Wave(seconds, 2.6, 0.1) * kDegree},
          pose);
  for (const bool left : {true, false}) PoseLeg(left, seconds, pose);
  return pose;
}

Vec3 HoldingHand(const Pose& pose) { return pose[kRightHand] * (RestJoints()[kRightHand] + 0.08 * RestArmDirection(false)); }

}  // namespace vorocast::synth
