// SPDX-License-Identifier: AGPL-3.0-or-later
#include "services/simulation/cell_collision.h"

#include <BulletCollision/BroadphaseCollision/btDispatcher.h>
#include <BulletCollision/CollisionDispatch/btCollisionObjectWrapper.h>
#include <BulletCollision/CollisionDispatch/btManifoldResult.h>
#include <LinearMath/btConvexHullComputer.h>

#include <limits>

#include "services/base/check.h"

namespace vorocast::simulation {
namespace {

using Eigen::Matrix3f;
using Eigen::Vector3f;

Vector3f ToEigen(const btVector3& v) { return {v.x(), v.y(), v.z()}; }
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

Vector3f Corner(const CellHull& hull, int i) { return {hull.corner_x[i], hull.corner_y[i], hull.corner_z[i]}; }

/// The hull's corner farthest along a direction of its own frame.
int FarthestCorner(const CellHull& hull, const Vector3f& direction) {
  int farthest = 0;
  (direction.x() * hull.corner_x + direction.y() * hull.corner_y + direction.z() * hull.corner_z).maxCoeff(&farthest);
  return farthest;
}

}  // namespace

CellHull::CellHull(const CellShape& shape, float units) {
  VOROCAST_CHECK(shape.hull.size() <= static_cast<std::size_t>(kCorners));
  corner_count = static_cast<int>(shape.hull.size());
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
}

Separation FindSeparation(const CellHull& a, const btTransform& world_from_a, const CellHull& b, const btTransform& world_from_b, float enough,
                          int last_axis) {
  const Matrix3f rotation_a = ToEigen(world_from_a.getBasis());
  const Matrix3f rotation_b = ToEigen(world_from_b.getBasis());
  const Vector3f between = ToEigen(world_from_b.getOrigin()) - ToEigen(world_from_a.getOrigin());
  const Matrix3f a_from_b = rotation_a.transpose() * rotation_b;
  const Matrix3f b_from_a = a_from_b.transpose();
  const Vector3f b_origin_in_a = rotation_a.transpose() * between;
  const Vector3f a_origin_in_b = -(rotation_b.transpose() * between);

  if (last_axis >= 0) {
    const bool of_a = last_axis < CellHull::kFaces;
    const float distance =
        of_a ? DistanceToFace(a, last_axis, b, b_from_a, a_origin_in_b) : DistanceToFace(b, last_axis - CellHull::kFaces, a, a_from_b, b_origin_in_a);
    if (distance > enough) return {.distance = distance, .axis = last_axis};
  }

  int face_a = 0;
  int face_b = 0;
  const float distance_a = DistancesToFaces(a, b, a_from_b, b_origin_in_a).maxCoeff(&face_a);
  if (distance_a > enough) return {.distance = distance_a, .axis = face_a};
  const float distance_b = DistancesToFaces(b, a, b_from_a, a_origin_in_b).maxCoeff(&face_b);
  if (distance_b > enough) return {.distance = distance_b, .axis = CellHull::kFaces + face_b};

  const float length = between.norm();
  const Vector3f line = length > 0 ? Vector3f(between / length) : Vector3f(Vector3f::UnitY());
  const int tip_of_a = FarthestCorner(a, rotation_a.transpose() * line);
  const int tip_of_b = FarthestCorner(b, -(rotation_b.transpose() * line));
  const Vector3f tip_a = rotation_a * Corner(a, tip_of_a) + ToEigen(world_from_a.getOrigin());
  const Vector3f tip_b = rotation_b * Corner(b, tip_of_b) + ToEigen(world_from_b.getOrigin());
  const float distance_line = line.dot(tip_b - tip_a);

  if (distance_line > std::max(distance_a, distance_b)) {
    return {.distance = distance_line, .normal = -line, .point = tip_b, .point_of_b = true, .axis = -1};
  }
  if (distance_a >= distance_b) {
    const Vector3f normal(a.normal_x[face_a], a.normal_y[face_a], a.normal_z[face_a]);
    const int deepest = FarthestCorner(b, -(b_from_a * normal));
    const Vector3f point = rotation_b * Corner(b, deepest) + ToEigen(world_from_b.getOrigin());
    return {.distance = distance_a, .normal = -(rotation_a * normal), .point = point, .point_of_b = true, .axis = face_a};
  }
  const Vector3f normal(b.normal_x[face_b], b.normal_y[face_b], b.normal_z[face_b]);
  const int deepest = FarthestCorner(a, -(a_from_b * normal));
  const Vector3f point = rotation_a * Corner(a, deepest) + ToEigen(world_from_a.getOrigin());
  return {.distance = distance_b, .normal = rotation_b * normal, .point = point, .point_of_b = false, .axis = CellHull::kFaces + face_b};
}

CellCollision::~CellCollision() {
  if (manifold_ != nullptr) m_dispatcher->releaseManifold(manifold_);
}

void CellCollision::processCollision(const btCollisionObjectWrapper* a, const btCollisionObjectWrapper* b, const btDispatcherInfo&,
                                     btManifoldResult* result) {
  const auto& hull_a = static_cast<const CellHull&>(*a->getCollisionShape());
  const auto& hull_b = static_cast<const CellHull&>(*b->getCollisionShape());
  const float margins = hull_a.getMarginNonVirtual() + hull_b.getMarginNonVirtual();
  constexpr float kContactDistance = 0.02F;  // Bullet's own threshold for a contact to begin
  const Separation found = FindSeparation(hull_a, a->getWorldTransform(), hull_b, b->getWorldTransform(), margins + kContactDistance, last_axis_);
  last_axis_ = found.axis;
  if (found.distance > margins + kContactDistance) {
    if (manifold_ != nullptr) m_dispatcher->releaseManifold(manifold_);
    manifold_ = nullptr;
    return;
  }
  if (manifold_ == nullptr) manifold_ = m_dispatcher->getNewManifold(a->getCollisionObject(), b->getCollisionObject());
  result->setPersistentManifold(manifold_);
  const float depth = found.distance - margins;
  const btVector3 normal(found.normal.x(), found.normal.y(), found.normal.z());
  const btVector3 corner(found.point.x(), found.point.y(), found.point.z());
  // Bullet wants the point on b's skin; a's lies `depth` along the normal from it.
  const btVector3 on_b = found.point_of_b ? corner + normal * hull_b.getMarginNonVirtual() : corner - normal * (hull_a.getMarginNonVirtual() + depth);
  result->addContactPoint(normal, on_b, depth);
  result->refreshContactPoints();
}

btCollisionAlgorithm* CellCollision::Factory::CreateCollisionAlgorithm(btCollisionAlgorithmConstructionInfo& info, const btCollisionObjectWrapper*,
                                                                       const btCollisionObjectWrapper*) {
  return new (info.m_dispatcher1->allocateCollisionAlgorithm(sizeof(CellCollision))) CellCollision(info);
}

}  // namespace vorocast::simulation
