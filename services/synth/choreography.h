// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include "services/synth/skeleton.h"

namespace vorocast::synth {

/// Where the dancer's hips are and which way they face: what skirt and steps follow. In world coordinates; the floor is y = 0.
struct Stance {
  geometry::Vec3 on_floor = geometry::Vec3::Zero();  // below the middle of the pelvis, before sway
  double heading_rad = 0;                            // about +y; 0 faces +z
};

/// The path over the floor at `seconds`: a small circle walked while turning.
Stance StanceAt(double seconds);

/// The dance: steps in place with a small kick, weight that shifts onto the standing foot, a left arm that sweeps from the hip to overhead, a right
/// arm held out for the cage. Sums of sinusoids; the feet are planted by two-bone inverse kinematics and slide nowhere. Defined for any time.
Pose PoseAt(double seconds);

/// Where the cage's string is held, in a pose.
geometry::Vec3 HoldingHand(const Pose& pose);

}  // namespace vorocast::synth
