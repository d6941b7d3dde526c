// SPDX-License-Identifier: AGPL-3.0-or-later
#include "services/synth/skeleton.h"

#include <cmath>
#include <numbers>

namespace vorocast::synth {
namespace {

using geometry::Vec3;

constexpr double kDegree = std::numbers::pi / 180;

constexpr PerBone<std::int32_t> kParents = {
    -1,           kPelvis,        kWaist,        kChest,  kNeck,      kChest,    kLeftCollar, kLeftUpperArm, kLeftForearm, kChest,
    kRightCollar, kRightUpperArm, kRightForearm, kPelvis, kLeftThigh, kLeftShin, kPelvis,     kRightThigh,   kRightShin};

PerBone<Vec3> MakeRestJoints() {
  PerBone<Vec3> joints;
  joints[kPelvis] = {0, kHipHeight_m + kPelvisAboveHips_m, 0};
  joints[kWaist] = {0, 1.07, -0.005};
  joints[kChest] = {0, 1.20, -0.015};
  joints[kNeck] = {0, 1.46, -0.022};
  joints[kSkull] = {0, 1.56, -0.005};
  for (const bool left : {true, false}) {
    const double side = left ? 1 : -1;
    const std::size_t arm = left ? kLeftCollar : kRightCollar;
    joints[arm] = {side * 0.02, 1.415, -0.01};
    joints[arm + 1] = {side * 0.165, 1.405, -0.018};
    joints[arm + 2] = joints[arm + 1] + kUpperArm_m * RestArmDirection(left);
    joints[arm + 3] = joints[arm + 2] + kForearm_m * RestArmDirection(left);
    const std::size_t leg = left ? kLeftThigh : kRightThigh;
    joints[leg] = {side * 0.088, kHipHeight_m, 0};
    joints[leg + 1] = joints[leg] + kThigh_m * RestLegDirection(left);
    joints[leg + 2] = joints[leg + 1] + kShin_m * RestLegDirection(left);
  }
  return joints;
}

}  // namespace

std::int32_t ParentOf(std::int32_t bone) { return kParents[static_cast<std::size_t>(bone)]; }

bool AreNear(std::int32_t a, std::int32_t b) {
  const auto chain_reaches = [](std::int32_t from, std::int32_t to) {
    for (int steps = 0; steps <= 2 && from >= 0; ++steps, from = ParentOf(from)) {
      if (from == to) return true;
    }
    return false;
  };
  return chain_reaches(a, b) || chain_reaches(b, a) || ParentOf(a) == ParentOf(b);
}

const PerBone<Vec3>& RestJoints() {
  static const PerBone<Vec3> kJoints = MakeRestJoints();
  return kJoints;
}

Vec3 RestArmDirection(bool left) { return {(left ? 1 : -1) * std::cos(40 * kDegree), -std::sin(40 * kDegree), 0}; }

Vec3 RestLegDirection(bool left) { return {(left ? 1 : -1) * std::sin(7 * kDegree), -std::cos(7 * kDegree), 0}; }

}  // namespace vorocast::synth
