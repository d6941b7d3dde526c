// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <BulletCollision/BroadphaseCollision/btCollisionAlgorithm.h>
#include <BulletCollision/CollisionDispatch/btCollisionCreateFunc.h>
#include <BulletCollision/CollisionShapes/btConvexHullShape.h>

#include <Eigen/Core>
#include <vector>

#include "services/simulation/cell_shapes.h"

namespace vorocast::simulation {

/// A cell's hull for Bullet, with its corners and face planes laid out for vector instructions.
class CellHull : public btConvexHullShape {
 public:
  static constexpr int kCorners = kHullCorners;  // the rest repeats the first
  static constexpr int kFaces = 32;              // room for a triangulated hull; the rest are planes that nothing is outside of
  // Unaligned, because Bullet's shapes bring an operator new of their own that aligns to 16 bytes only.
  using Corners = Eigen::Array<float, kCorners, 1, Eigen::DontAlign>;
  using Faces = Eigen::Array<float, kFaces, 1, Eigen::DontAlign>;

  /// `units`: Bullet units a metre.
  CellHull(const CellShape& shape, float units);

  /// How far contact points may drift before they are dropped. Bullet's own two hundredths of the size lets a rolling lump lose all but the
  /// newest of its contacts, and it sinks.
  btScalar getContactBreakingThreshold(btScalar) const override { return kBreakingThreshold; }
  static constexpr float kBreakingThreshold = 0.25F;  // Bullet units

  Corners corner_x, corner_y, corner_z;              // body frame, Bullet units, without margin
  Faces normal_x, normal_y, normal_z, plane_offset;  // outwards: a face's points have normal·x = offset
  int corner_count = 0;
  float radius = 0;                          // CellShape::radius in Bullet units
  float inner_radius = 0;                    // of the sphere about the body's origin that fits in, margin included; 0 if the origin is outside
  std::vector<Eigen::Vector3f> all_corners;  // with those that the hull was thinned out of: the ground is flat, and shows what sinks into it
};

/// How deep cells were in each other in a step, Bullet units.
struct CellOverlaps {
  float pressed = 0;  // how much deeper two cells got than they were when they began to collide, or have been since
  float begun = 0;    // how deep two cells were in each other when they began to collide
};

/// Contacts between two cells by separating axes: the face normals of both hulls and the line between the centres. Leaving out the
/// crossed edges costs little on such lumps, and this is an order of magnitude cheaper than GJK and EPA. The axis that separated a pair
/// in the last step is tried first and mostly settles it.
///
/// Two cells that are going to meet within the step are in contact before they do: the solver lets them come as near as they are apart, and
/// no farther. Two that begin to collide while they are in each other (recalled cells may be, and then one is let go) are not thrown apart:
/// they may get no deeper, and are let out at a bounded speed.
class CellCollision : public btCollisionAlgorithm {
 public:
  CellCollision(const btCollisionAlgorithmConstructionInfo& info, CellOverlaps* overlaps) : btCollisionAlgorithm(info), overlaps_(overlaps) {}
  ~CellCollision() override;

  void processCollision(const btCollisionObjectWrapper* a, const btCollisionObjectWrapper* b, const btDispatcherInfo& info,
                        btManifoldResult* result) override;
  /// Continuous collision is off.
  btScalar calculateTimeOfImpact(btCollisionObject*, btCollisionObject*, const btDispatcherInfo&, btManifoldResult*) override { return 1; }
  void getAllContactManifolds(btManifoldArray& manifolds) override {
    if (manifold_ != nullptr) manifolds.push_back(manifold_);
  }

  struct Factory : btCollisionAlgorithmCreateFunc {
    btCollisionAlgorithm* CreateCollisionAlgorithm(btCollisionAlgorithmConstructionInfo& info, const btCollisionObjectWrapper* a,
                                                   const btCollisionObjectWrapper* b) override;
    CellOverlaps overlaps;  // of all pairs, since it was last cleared
  };

 private:
  float Allowed(float depth);

  CellOverlaps* overlaps_;
  btPersistentManifold* manifold_ = nullptr;  // only while there is contact
  int last_axis_ = -1;                        // face of a, or kFaces + face of b, that separated the pair
  bool begun_ = false;
  float least_depth_ = 0;  // Bullet units, that the two have had since they began to collide
};

/// Contacts between a cell and an endless plane: each corner that touches it, at once.
class CellPlaneCollision : public btCollisionAlgorithm {
 public:
  CellPlaneCollision(const btCollisionAlgorithmConstructionInfo& info, bool swapped) : btCollisionAlgorithm(info), swapped_(swapped) {}
  ~CellPlaneCollision() override;

  void processCollision(const btCollisionObjectWrapper* a, const btCollisionObjectWrapper* b, const btDispatcherInfo& info,
                        btManifoldResult* result) override;
  btScalar calculateTimeOfImpact(btCollisionObject*, btCollisionObject*, const btDispatcherInfo&, btManifoldResult*) override { return 1; }
  void getAllContactManifolds(btManifoldArray& manifolds) override {
    if (manifold_ != nullptr) manifolds.push_back(manifold_);
  }

  /// m_swapped: the plane comes first.
  struct Factory : btCollisionAlgorithmCreateFunc {
    btCollisionAlgorithm* CreateCollisionAlgorithm(btCollisionAlgorithmConstructionInfo& info, const btCollisionObjectWrapper* a,
                                                   const btCollisionObjectWrapper* b) override;
  };

 private:
  btPersistentManifold* manifold_ = nullptr;
  bool swapped_;
};

/// Where two hulls touch, in the world and without margins.
struct Touch {
  Eigen::Vector3f point;  // a corner of one of them
  float distance;         // from the other, along the normal; negative inside
};

/// The axis on which two hulls are farthest apart, or least deep in each other.
struct Separation {
  static constexpr int kTouchesMax = 4;

  float distance = 0;                                // between the hulls without margins; negative inside
  int axis = -1;                                     // as CellCollision::last_axis_; −1 for the line between the centres
  Eigen::Vector3f normal = Eigen::Vector3f::Zero();  // from b to a, in the world
  bool corners_of_b = true;                          // whose corners the touches are
  int touch_count = 0;                               // 0 when farther apart than `enough`
  Touch touches[kTouchesMax];                        // the deepest first
};

/// `last_axis`: tried first; when it shows more than `enough`, the search ends there. `way`: that b is going to go, in the world and as seen
/// from a. Then nothing touches only if some axis shows more than `enough` before and after, and corners touch that are on the way.
Separation FindSeparation(const CellHull& a, const btTransform& world_from_a, const CellHull& b, const btTransform& world_from_b, float enough,
                          int last_axis, const Eigen::Vector3f& way = Eigen::Vector3f::Zero());

}  // namespace vorocast::simulation
