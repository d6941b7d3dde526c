// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "services/geometry/rigid3.h"

namespace vorocast::synth {

/// The dancer's bones. Left is +x when the dancer stands at rest and faces +z.
enum Bone : std::int32_t {
  kPelvis,
  kWaist,
  kChest,
  kNeck,
  kSkull,
  kLeftCollar,
  kLeftUpperArm,
  kLeftForearm,
  kLeftHand,
  kRightCollar,
  kRightUpperArm,
  kRightForearm,
  kRightHand,
  kLeftThigh,
  kLeftShin,
  kLeftFoot,
  kRightThigh,
  kRightShin,
  kRightFoot,
  kBones
};

template <typename T>
using PerBone = std::array<T, static_cast<std::size_t>(kBones)>;

/// The bone above, −1 for the pelvis. A bone comes after its parent.
std::int32_t ParentOf(std::int32_t bone);
/// True for bones that share a joint or are two joints apart: only those may pull at the same skin.
bool AreNear(std::int32_t a, std::int32_t b);

/// Where each bone's upper joint is at rest, metres: 1.75 m tall, arms 40° below the horizontal, legs a little apart.
const PerBone<geometry::Vec3>& RestJoints();
/// The far ends of hands and feet at rest, and the direction of each arm and leg.
geometry::Vec3 RestArmDirection(bool left);
geometry::Vec3 RestLegDirection(bool left);

constexpr double kUpperArm_m = 0.275;
constexpr double kForearm_m = 0.245;
constexpr double kThigh_m = 0.435;
constexpr double kShin_m = 0.415;
constexpr double kHipHeight_m = 0.925;
/// The pelvis joint's height above the hips.
constexpr double kPelvisAboveHips_m = 0.035;

/// A pose: world_from_rest of every bone; x_world = pose[bone] * x_rest.
using Pose = PerBone<geometry::Rigid3>;

}  // namespace vorocast::synth
