// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include "services/geometry/vector.h"

namespace vorocast::geometry {

/// A rigid transform. Names carry its direction: with b_from_a, x_in_b = b_from_a * x_in_a = rotation * x_in_a + translation.
struct Rigid3 {
  Quat rotation = Quat::Identity();  // unit
  Vec3 translation = Vec3::Zero();   // metres

  Vec3 operator*(const Vec3& x) const { return rotation * x + translation; }
  Rigid3 Inverse() const {
    const Quat inverse = rotation.conjugate();
    return {inverse, -(inverse * translation)};
  }
};

/// c_from_a = c_from_b * b_from_a.
inline Rigid3 operator*(const Rigid3& c_from_b, const Rigid3& b_from_a) {
  return {(c_from_b.rotation * b_from_a.rotation).normalized(), c_from_b.rotation * b_from_a.translation + c_from_b.translation};
}

/// The pose at fraction t in [0, 1] between two: positions linearly, rotations by slerp (paper, section 5.2).
inline Rigid3 Interpolate(const Rigid3& from, const Rigid3& to, double t) {
  return {from.rotation.slerp(t, to.rotation), (1 - t) * from.translation + t * to.translation};
}

}  // namespace vorocast::geometry
