// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <btBulletDynamicsCommon.h>

namespace vorocast::simulation {

/// A scene object's surface as what no released cell's middle goes through, however fast it is and however little the contacts stop it.
/// Made after a step, for that step. Bullet units.
class ObjectSurface {
 public:
  /// `before`: where the object was when the step of `dt` seconds began. The object outlives this.
  ObjectSurface(btRigidBody& object, const btTransform& before, float dt);

  /// A cell whose middle was at `centre_before` and is beyond the surface now, or nearer to it than `inner_radius` (of the largest ball about its
  /// middle in it), is put back on its own way to where that ball just touches, or as near as it was, and keeps none of the speed that took
  /// it there.
  void HoldOut(btRigidBody& cell, const btVector3& centre_before, float inner_radius) const;

 private:
  btRigidBody& object_;
  btTransform before_, now_;
  btVector3 low_, high_;  // the object's bounds, in its own frame
  float dt_;
};

}  // namespace vorocast::simulation
