// SPDX-License-Identifier: AGPL-3.0-or-later
#include "services/simulation/cell_collision.h"

#include <BulletCollision/BroadphaseCollision/btDispatcher.h>
#include <BulletCollision/CollisionDispatch/btCollisionObjectWrapper.h>
#include <BulletCollision/CollisionDispatch/btManifoldResult.h>
#include <BulletCollision/CollisionShapes/btStaticPlaneShape.h>
#include <BulletDynamics/Dynamics/btRigidBody.h>
#include <LinearMath/btConvexHullComputer.h>

#include <limits>

#include "services/base/check.h"

namespace vorocast::simulation {
namespace {

using Eigen::Matrix3f;
using Eigen::Vector3f;

constexpr float kContactDistance = 0.02F;  // Bullet units between the skins; Bullet's boxes reach as far
constexpr float kLettingOut = 1.25F;       // Bullet units that cells which began in each other count as too deep by: 0.6 m/s at 240 Hz

Vector3f ToEigen(const btVector3& v) { return {v.x(), v.y(), v.z()}; }
btVector3 ToBullet(const Vector3f& v) { return {v.x(), v.y(), v.z()}; }
Matrix3f ToEigen(const btMatrix3x3& m) {
  Matrix3f result;
  for (int row = 0; row < 3; ++row) result.row(row) << m[row].x(), m[row].y(), m[row].z();
  return result;
}

/// normal · x − offset of the nearest of b's corners to one of a's planes.
float DistanceToFace(const CellHull& a, int face, const CellHull& b, const Matrix3f& b_from_a, const Vector3f& a_origin_in_b) {
  const Vector3f normal = b_from_a * Vector3f(a.normal_x[face], a.normal_y[face], a.normal_z[face]);
  const float nearest = (normal.x() * b.corner_x + normal.y() * b.corner_y + normal.z() * b.corner_z).minCoeff();
  return nearest - normal.dot(a_origin_in_b) - a.plane_offset[face];
}

/// For every face of a, the distance of b's nearest corner; b's corners are given in a's frame.
CellHull::Faces DistancesToFaces(const CellHull& a, const CellHull& b, const Matrix3f& a_from_b, const Vector3f& b_origin_in_a) {
  const CellHull::Corners x = a_from_b(0, 0) * b.corner_x + a_from_b(0, 1) * b.corner_y + a_from_b(0, 2) * b.corner_z + b_origin_in_a.x();
  const CellHull::Corners y = a_from_b(1, 0) * b.corner_x + a_from_b(1, 1) * b.corner_y + a_from_b(1, 2) * b.corner_z + b_origin_in_a.y();
  const CellHull::Corners z = a_from_b(2, 0) * b.corner_x + a_from_b(2, 1) * b.corner_y + a_from_b(2, 2) * b.corner_z + b_origin_in_a.z();
  CellHull::Faces nearest = CellHull::Faces::Constant(std::numeric_limits<float>::max());
  for (int i = 0; i < b.corner_count; ++i) nearest = nearest.min(x[i] * a.normal_x + y[i] * a.normal_y + z[i] * a.normal_z);
  return nearest - a.plane_offset;
}

/// Where a body goes in the coming step and how far its turning moves its points, if nothing stops it. Bullet units.
struct Approach {
  Vector3f way = Vector3f::Zero();
  float turn = 0;
};
Approach FindApproach(const btCollisionObject& object, float radius, float dt) {
  constexpr float kWayMax = 20;
  constexpr float kTurnMax = 0.5F;
  const auto* body = btRigidBody::upcast(&object);
  if (body == nullptr || (body->isStaticObject() && !body->isKinematicObject())) return {};
  Approach approach;
  if (body->isActive()) approach.way = dt * ToEigen(body->getLinearVelocity() + dt * body->getGravity());
  approach.turn = std::min(dt * radius * body->getAngularVelocity().length(), kTurnMax);
  const float length = approach.way.norm();
  if (length > kWayMax) approach.way *= kWayMax / length;
  return approach;
}

/// A cell's contacts in one step. While one of them is far off, all of them are made anew: Bullet would take corners for the same that are nearer
/// to each other than that.
class Contacts {
 public:
  Contacts(btPersistentManifold& manifold, btManifoldResult& result, float farthest) : manifold_(manifold), result_(result) {
    far_ = farthest > CellHull::kBreakingThreshold;
    if (far_) manifold.clearManifold();
    manifold.setContactBreakingThreshold(far_ ? 1.1F * farthest : CellHull::kBreakingThreshold);
    restitution_ = btManifoldResult::calculateCombinedRestitution(result.getBody0Internal(), result.getBody1Internal());
  }
  /// The normal points from b to a; on_b belongs to b.
  void Add(const btVector3& normal, const btVector3& on_b, float distance) {
    if (distance > 0) distance *= 1 - std::min(restitution_, 1.0F);
    if (!far_) {
      result_.addContactPoint(normal, on_b, distance);
      return;
    }
    const btCollisionObject* a = result_.getBody0Internal();
    const btCollisionObject* b = result_.getBody1Internal();
    const btVector3 on_a = on_b + normal * distance;
    const bool swapped = manifold_.getBody0() != a;
    const btVector3 in_a = a->getWorldTransform().invXform(on_a);
    const btVector3 in_b = b->getWorldTransform().invXform(on_b);
    btManifoldPoint point = swapped ? btManifoldPoint(in_b, in_a, -normal, distance) : btManifoldPoint(in_a, in_b, normal, distance);
    point.m_positionWorldOnA = swapped ? on_b : on_a;
    point.m_positionWorldOnB = swapped ? on_a : on_b;
    point.m_combinedFriction = btManifoldResult::calculateCombinedFriction(a, b);
    point.m_combinedRestitution = restitution_;
    btPlaneSpace1(point.m_normalWorldOnB, point.m_lateralFrictionDir1, point.m_lateralFrictionDir2);
    manifold_.addManifoldPoint(point);
  }

 private:
  btPersistentManifold& manifold_;
  btManifoldResult& result_;
  bool far_;
  /// It acts on the speed before the step, and would be lost on the way to a contact that is ahead: what bounces does so from as much nearer.
  float restitution_;
};

Vector3f Corner(const CellHull& hull, int i) { return {hull.corner_x[i], hull.corner_y[i], hull.corner_z[i]}; }

/// A hull's corners along a direction of its own frame.
CellHull::Corners Along(const CellHull& hull, const Vector3f& direction) {
  return direction.x() * hull.corner_x + direction.y() * hull.corner_y + direction.z() * hull.corner_z;
}

/// The corners of `other` that lie below a face of `reference`, no deeper sideways outside than they may be rounded: the deepest first, then
/// those spread farthest.
void TouchFace(const CellHull& reference, int face, const CellHull& other, const btTransform& world_from_other, const Matrix3f& reference_from_other,
               const Vector3f& other_origin_in_reference, float enough, Separation& found) {
  constexpr float kSideways = 0.05F;  // Bullet units
  const Vector3f normal(reference.normal_x[face], reference.normal_y[face], reference.normal_z[face]);
  struct Candidate {
    Vector3f point;  // in the reference's frame
    float distance;
    int corner;
  };
  Candidate candidates[CellHull::kCorners];
  int count = 0;
  int deepest = 0;
  for (int i = 0; i < other.corner_count; ++i) {
    const Vector3f point = reference_from_other * Corner(other, i) + other_origin_in_reference;
    const float distance = normal.dot(point) - reference.plane_offset[face];
    if (distance > enough) continue;
    candidates[count] = {point, distance, i};
    if (distance < candidates[deepest].distance) deepest = count;
    ++count;
  }
  // Sideways outside the reference a corner does not touch it; the deepest stands for the pair in any case.
  int kept = 0;
  for (int i = 0; i < count; ++i) {
    const Vector3f p = candidates[i].point - std::max(candidates[i].distance, 0.0F) * normal;  // where it is going to meet the face
    const bool inside =
        i == deepest ||
        (p.x() * reference.normal_x + p.y() * reference.normal_y + p.z() * reference.normal_z - reference.plane_offset).maxCoeff() < kSideways;
    if (!inside) continue;
    if (i == deepest) deepest = kept;
    candidates[kept++] = candidates[i];
  }
  std::swap(candidates[0], candidates[deepest]);
  for (int chosen = 1; chosen < std::min(kept, Separation::kTouchesMax); ++chosen) {
    int farthest = chosen;
    float farthest_distance = -1;
    for (int i = chosen; i < kept; ++i) {
      float nearest = std::numeric_limits<float>::max();
      for (int j = 0; j < chosen; ++j) nearest = std::min(nearest, (candidates[i].point - candidates[j].point).squaredNorm());
      if (nearest > farthest_distance) {
        farthest_distance = nearest;
        farthest = i;
      }
    }
    std::swap(candidates[chosen], candidates[farthest]);
  }
  found.touch_count = std::min(kept, Separation::kTouchesMax);
  const Matrix3f rotation = ToEigen(world_from_other.getBasis());
  const Vector3f origin = ToEigen(world_from_other.getOrigin());
  for (int i = 0; i < found.touch_count; ++i) found.touches[i] = {rotation * Corner(other, candidates[i].corner) + origin, candidates[i].distance};
}

}  // namespace

CellHull::CellHull(const CellShape& shape, float units) {
  VOROCAST_CHECK(shape.hull.size() <= static_cast<std::size_t>(kCorners));
  corner_count = static_cast<int>(shape.hull.size());
  radius = units * static_cast<float>(shape.radius);
  std::vector<float> coordinates;
  for (int i = 0; i < kCorners; ++i) {
    const geometry::Vec3f corner = units * shape.hull[i < corner_count ? static_cast<std::size_t>(i) : 0].cast<float>();
    corner_x[i] = corner.x();
    corner_y[i] = corner.y();
    corner_z[i] = corner.z();
    if (i >= corner_count) continue;
    addPoint(btVector3(corner.x(), corner.y(), corner.z()), false);
    coordinates.insert(coordinates.end(), {corner.x(), corner.y(), corner.z()});
  }
  for (const geometry::Vec3& corner : shape.all_corners) all_corners.push_back(units * corner.cast<float>());
  setMargin(units * static_cast<float>(kHullMargin));
  recalcLocalAabb();

  normal_x.setZero();
  normal_y.setZero();
  normal_z.setZero();
  plane_offset.setConstant(std::numeric_limits<float>::max());
  btConvexHullComputer computer;
  computer.compute(coordinates.data(), 3 * sizeof(float), corner_count, 0, 0);
  const Vector3f inside(corner_x.head(corner_count).mean(), corner_y.head(corner_count).mean(), corner_z.head(corner_count).mean());
  const int faces = std::min(computer.faces.size(), kFaces);
  for (int f = 0; f < faces; ++f) {
    const auto* edge = &computer.edges[computer.faces[f]];
    const Vector3f p = ToEigen(computer.vertices[edge->getSourceVertex()]);
    // Newell's normal, which a sliver of a corner does not upset.
    Vector3f normal = Vector3f::Zero();
    const auto* side = edge;
    do {
      normal += (ToEigen(computer.vertices[side->getSourceVertex()]) - p).cross(ToEigen(computer.vertices[side->getTargetVertex()]) - p);
      side = side->getNextEdgeOfFace();
    } while (side != edge);
    if (normal.norm() < 1e-6F) continue;
    normal.normalize();
    if (normal.dot(p - inside) < 0) normal = -normal;
    normal_x[f] = normal.x();
    normal_y[f] = normal.y();
    normal_z[f] = normal.z();
    // All corners lie on the plane's inner side, whatever the rounding.
    plane_offset[f] = (normal.x() * corner_x + normal.y() * corner_y + normal.z() * corner_z).maxCoeff();
  }
  inner_radius = std::clamp(plane_offset.minCoeff() + getMarginNonVirtual(), 0.0F, radius);
}

Separation FindSeparation(const CellHull& a, const btTransform& world_from_a, const CellHull& b, const btTransform& world_from_b, float enough,
                          int last_axis, const Vector3f& way) {
  const Matrix3f rotation_a = ToEigen(world_from_a.getBasis());
  const Matrix3f rotation_b = ToEigen(world_from_b.getBasis());
  const Vector3f between = ToEigen(world_from_b.getOrigin()) - ToEigen(world_from_a.getOrigin());
  const Matrix3f a_from_b = rotation_a.transpose() * rotation_b;
  const Matrix3f b_from_a = a_from_b.transpose();
  const Vector3f b_origin_in_a = rotation_a.transpose() * between;
  const Vector3f a_origin_in_b = -(rotation_b.transpose() * between);

  const Vector3f way_in_a = rotation_a.transpose() * way;
  const Vector3f way_in_b = -(rotation_b.transpose() * way);  // a's, as seen from b
  const auto along = [](const CellHull& hull, int face, const Vector3f& w) {
    return hull.normal_x[face] * w.x() + hull.normal_y[face] * w.y() + hull.normal_z[face] * w.z();
  };
  if (last_axis >= 0) {
    const bool of_a = last_axis < CellHull::kFaces;
    const int face = of_a ? last_axis : last_axis - CellHull::kFaces;
    const float distance = of_a ? DistanceToFace(a, face, b, b_from_a, a_origin_in_b) : DistanceToFace(b, face, a, a_from_b, b_origin_in_a);
    const float least = distance + std::min(0.0F, of_a ? along(a, face, way_in_a) : along(b, face, way_in_b));
    if (least > enough) return {.distance = distance, .axis = last_axis};
  }

  // Before the step, and the less of before and after.
  int face_a = 0;
  int face_b = 0;
  int parting_a = 0;
  int parting_b = 0;
  const CellHull::Faces distances_a = DistancesToFaces(a, b, a_from_b, b_origin_in_a);
  const CellHull::Faces change_a = a.normal_x * way_in_a.x() + a.normal_y * way_in_a.y() + a.normal_z * way_in_a.z();
  if ((distances_a + change_a.min(0.0F)).maxCoeff(&parting_a) > enough) return {.distance = distances_a[parting_a], .axis = parting_a};
  const CellHull::Faces distances_b = DistancesToFaces(b, a, b_from_a, a_origin_in_b);
  const CellHull::Faces change_b = b.normal_x * way_in_b.x() + b.normal_y * way_in_b.y() + b.normal_z * way_in_b.z();
  if ((distances_b + change_b.min(0.0F)).maxCoeff(&parting_b) > enough)
    return {.distance = distances_b[parting_b], .axis = CellHull::kFaces + parting_b};
  const float distance_a = distances_a.maxCoeff(&face_a);
  const float distance_b = distances_b.maxCoeff(&face_b);

  Separation found;
  const float length = between.norm();
  const Vector3f line = length > 0 ? Vector3f(between / length) : Vector3f(Vector3f::UnitY());
  int tip = 0;
  const float reach_a = Along(a, rotation_a.transpose() * line).maxCoeff();
  const float reach_b = -Along(b, rotation_b.transpose() * line).minCoeff(&tip);
  const float distance_line = length - reach_a - reach_b;
  if (distance_line > std::max(distance_a, distance_b)) {
    found.distance = distance_line;
    found.normal = -line;
    if (distance_line + std::min(0.0F, line.dot(way)) <= enough) {
      found.touches[0] = {rotation_b * Corner(b, tip) + ToEigen(world_from_b.getOrigin()), distance_line};
      found.touch_count = 1;
    }
    return found;
  }
  const bool face_of_a = distance_a >= distance_b;
  const CellHull& reference = face_of_a ? a : b;
  const int face = face_of_a ? face_a : face_b;
  const Vector3f normal(reference.normal_x[face], reference.normal_y[face], reference.normal_z[face]);
  found.distance = face_of_a ? distance_a : distance_b;
  found.normal = face_of_a ? Vector3f(-(rotation_a * normal)) : Vector3f(rotation_b * normal);
  found.axis = face_of_a ? face : CellHull::kFaces + face;
  found.corners_of_b = face_of_a;
  const float reach = enough + std::max(0.0F, -along(reference, face, face_of_a ? way_in_a : way_in_b));
  if (face_of_a) {
    TouchFace(a, face, b, world_from_b, a_from_b, b_origin_in_a, reach, found);
  } else {
    TouchFace(b, face, a, world_from_a, b_from_a, a_origin_in_b, reach, found);
  }
  return found;
}

CellCollision::~CellCollision() {
  if (manifold_ != nullptr) m_dispatcher->releaseManifold(manifold_);
}

/// How deep of `depth` the pair may be: what it began with, but for what it is let out by in this step.
float CellCollision::Allowed(float depth) {
  if (!begun_) {
    begun_ = true;
    least_depth_ = std::max(depth, 0.0F);
    overlaps_->begun = std::max(overlaps_->begun, least_depth_);
  }
  least_depth_ = std::clamp(depth, 0.0F, least_depth_);
  overlaps_->pressed = std::max(overlaps_->pressed, depth - least_depth_);
  return std::max(least_depth_ - kLettingOut, 0.0F);
}

void CellCollision::processCollision(const btCollisionObjectWrapper* a, const btCollisionObjectWrapper* b, const btDispatcherInfo& info,
                                     btManifoldResult* result) {
  const auto& hull_a = static_cast<const CellHull&>(*a->getCollisionShape());
  const auto& hull_b = static_cast<const CellHull&>(*b->getCollisionShape());
  const float margins = hull_a.getMarginNonVirtual() + hull_b.getMarginNonVirtual();
  const Approach approach_a = FindApproach(*a->getCollisionObject(), hull_a.radius, info.m_timeStep);
  const Approach approach_b = FindApproach(*b->getCollisionObject(), hull_b.radius, info.m_timeStep);
  const float enough = margins + kContactDistance + approach_a.turn + approach_b.turn;
  const Separation found =
      FindSeparation(hull_a, a->getWorldTransform(), hull_b, b->getWorldTransform(), enough, last_axis_, approach_b.way - approach_a.way);
  last_axis_ = found.axis;
  const float allowed = Allowed(margins - found.distance);
  if (found.touch_count == 0) {
    if (manifold_ != nullptr) m_dispatcher->releaseManifold(manifold_);
    manifold_ = nullptr;
    return;
  }
  if (manifold_ == nullptr) manifold_ = m_dispatcher->getNewManifold(a->getCollisionObject(), b->getCollisionObject());
  result->setPersistentManifold(manifold_);
  float farthest = found.touches[0].distance;
  for (int i = 1; i < found.touch_count; ++i) farthest = std::max(farthest, found.touches[i].distance);
  Contacts contacts(*manifold_, *result, farthest - margins);
  const btVector3 normal = ToBullet(found.normal);
  for (int i = 0; i < found.touch_count; ++i) {
    const float distance = found.touches[i].distance - margins + allowed;
    const btVector3 corner = ToBullet(found.touches[i].point);
    // Bullet wants the point on b's skin; a's lies `distance` along the normal from it.
    contacts.Add(normal,
                 found.corners_of_b ? corner + normal * hull_b.getMarginNonVirtual() : corner - normal * (hull_a.getMarginNonVirtual() + distance),
                 distance);
  }
  result->refreshContactPoints();
}

btCollisionAlgorithm* CellCollision::Factory::CreateCollisionAlgorithm(btCollisionAlgorithmConstructionInfo& info, const btCollisionObjectWrapper*,
                                                                       const btCollisionObjectWrapper*) {
  return new (info.m_dispatcher1->allocateCollisionAlgorithm(sizeof(CellCollision))) CellCollision(info, &overlaps);
}

CellPlaneCollision::~CellPlaneCollision() {
  if (manifold_ != nullptr) m_dispatcher->releaseManifold(manifold_);
}

void CellPlaneCollision::processCollision(const btCollisionObjectWrapper* a, const btCollisionObjectWrapper* b, const btDispatcherInfo& info,
                                          btManifoldResult* result) {
  const btCollisionObjectWrapper& cell = swapped_ ? *b : *a;
  const btCollisionObjectWrapper& ground = swapped_ ? *a : *b;
  const auto& hull = static_cast<const CellHull&>(*cell.getCollisionShape());
  const auto& plane = static_cast<const btStaticPlaneShape&>(*ground.getCollisionShape());
  const btVector3 normal = ground.getWorldTransform().getBasis() * plane.getPlaneNormal();
  const float offset = plane.getPlaneConstant() + normal.dot(ground.getWorldTransform().getOrigin()) + hull.getMarginNonVirtual();

  const Vector3f up = ToEigen(cell.getWorldTransform().getBasis().transpose() * normal);
  const float centre = normal.dot(cell.getWorldTransform().getOrigin()) - offset;
  const Approach approach = FindApproach(*cell.getCollisionObject(), hull.radius, info.m_timeStep);
  const float reach = kContactDistance + approach.turn + std::max(0.0F, -approach.way.dot(ToEigen(normal)));
  float farthest = -std::numeric_limits<float>::max();
  for (const Vector3f& corner : hull.all_corners) {
    const float distance = centre + up.dot(corner);
    if (distance <= reach) farthest = std::max(farthest, distance);
  }
  const bool touches = farthest > -std::numeric_limits<float>::max();
  if (touches) {
    if (manifold_ == nullptr) manifold_ = m_dispatcher->getNewManifold(a->getCollisionObject(), b->getCollisionObject());
    result->setPersistentManifold(manifold_);
    Contacts contacts(*manifold_, *result, farthest);
    for (const Vector3f& corner : hull.all_corners) {
      const float distance = centre + up.dot(corner);
      if (distance > reach) continue;
      const btVector3 on_cell = cell.getWorldTransform() * ToBullet(corner) - normal * hull.getMarginNonVirtual();
      // The normal points from b to a, the point is b's.
      contacts.Add(swapped_ ? -normal : normal, swapped_ ? on_cell : on_cell - normal * distance, distance);
    }
  }
  if (touches) {
    result->refreshContactPoints();
  } else if (manifold_ != nullptr) {
    m_dispatcher->releaseManifold(manifold_);
    manifold_ = nullptr;
  }
}

btCollisionAlgorithm* CellPlaneCollision::Factory::CreateCollisionAlgorithm(btCollisionAlgorithmConstructionInfo& info,
                                                                            const btCollisionObjectWrapper*, const btCollisionObjectWrapper*) {
  return new (info.m_dispatcher1->allocateCollisionAlgorithm(sizeof(CellPlaneCollision))) CellPlaneCollision(info, m_swapped);
}

}  // namespace vorocast::simulation
