// SPDX-License-Identifier: AGPL-3.0-or-later
#include "services/simulation/object_surface.h"

#include <algorithm>

namespace vorocast::simulation {
namespace {

/// Whether the way from one point to another comes within `pad` of a box.
bool SegmentNears(const btVector3& from, const btVector3& to, const btVector3& low, const btVector3& high, float pad) {
  for (int axis = 0; axis < 3; ++axis) {
    if (std::max(from[axis], to[axis]) + pad < low[axis] || std::min(from[axis], to[axis]) - pad > high[axis]) return false;
  }
  return true;
}

}  // namespace

ObjectSurface::ObjectSurface(btRigidBody& object, const btTransform& before, float dt)
    : object_(object), before_(before), now_(object.getWorldTransform()), dt_(dt) {
  object.getCollisionShape()->getAabb(btTransform::getIdentity(), low_, high_);
}

void ObjectSurface::HoldOut(btRigidBody& cell, const btVector3& centre_before, float inner_radius) const {
  const btVector3 from = before_.invXform(centre_before);
  const btVector3 to = now_.invXform(cell.getWorldTransform().getOrigin());
  const float length = (to - from).length();
  if (length < 1e-4F || !SegmentNears(from, to, low_, high_, inner_radius)) return;
  const btVector3 beyond = to + (inner_radius / length) * (to - from);  // the ball's front
  btCollisionWorld::ClosestRayResultCallback hit(from, beyond);
  btCollisionWorld::rayTestSingle(btTransform(btQuaternion::getIdentity(), from), btTransform(btQuaternion::getIdentity(), beyond), &object_,
                                  object_.getCollisionShape(), btTransform::getIdentity(), hit);
  if (!hit.hasHit()) return;
  const btVector3 normal = hit.m_hitNormalWorld.normalized();  // towards where the cell came from
  const btVector3 place = from.lerp(beyond, hit.m_closestHitFraction);
  const float distance_before = normal.dot(from - place);
  const float distance = normal.dot(to - place);
  const float wanted = std::min(distance_before, inner_radius);
  if (distance_before <= 0 || distance >= wanted) return;
  const btVector3 held = from.lerp(to, (distance_before - wanted) / (distance_before - distance));
  btTransform pose = cell.getWorldTransform();
  pose.setOrigin(now_ * held);
  cell.setWorldTransform(pose);
  cell.setInterpolationWorldTransform(pose);
  // As seen from the object, whose own motion carries the cell along.
  const btVector3 out = now_.getBasis() * normal;
  const btVector3 surface_velocity = (pose.getOrigin() - before_ * held) / dt_;
  const float inwards = out.dot(cell.getLinearVelocity() - surface_velocity);
  if (inwards < 0) cell.setLinearVelocity(cell.getLinearVelocity() - inwards * out);
  cell.activate();
}

}  // namespace vorocast::simulation
