// SPDX-License-Identifier: AGPL-3.0-or-later
#include "services/simulation/cell_collision.h"

#include <BulletCollision/CollisionDispatch/btCollisionDispatcher.h>
#include <BulletCollision/CollisionDispatch/btCollisionObject.h>
#include <BulletCollision/CollisionDispatch/btDefaultCollisionConfiguration.h>
#include <BulletCollision/CollisionShapes/btStaticPlaneShape.h>
#include <BulletCollision/NarrowPhaseCollision/btGjkEpaPenetrationDepthSolver.h>
#include <BulletCollision/NarrowPhaseCollision/btGjkPairDetector.h>
#include <BulletCollision/NarrowPhaseCollision/btPointCollector.h>
#include <BulletCollision/NarrowPhaseCollision/btVoronoiSimplexSolver.h>
#include <gtest/gtest.h>

#include <set>

#include "services/base/random.h"
#include "services/simulation/near_pairs.h"
#include "tests/unit/services/simulation/synthetic_take.h"

namespace vorocast::simulation {
namespace {

using geometry::Vec3;

CellHull Hull(const testing::Polyhedron& polyhedron) {
  geometry::Cells cells;
  testing::AddCell(cells, polyhedron, Vec3::Zero());
  // Nothing taken off, so that distances are the polyhedron's own.
  CellShape shape = MakeCellShapes(cells, {.shrink_m = 0})[0];
  for (Vec3& corner : shape.hull) corner *= 1 + kHullMargin / corner.cwiseAbs().maxCoeff();
  return CellHull(shape, 100);
}

btTransform At(const Vec3& place, const geometry::Quat& turn = geometry::Quat::Identity()) {
  return btTransform(btQuaternion(turn.x(), turn.y(), turn.z(), turn.w()), btVector3(place.x(), place.y(), place.z()));
}

btTransform RandomPose(base::Random& random, double spread) {
  const geometry::Quat turn = geometry::Quat(random.Gaussian(), random.Gaussian(), random.Gaussian(), random.Gaussian()).normalized();
  return At(spread * Vec3(random.Gaussian(), random.Gaussian(), random.Gaussian()), turn);
}

float GjkDistance(const CellHull& a, const btTransform& pose_a, const CellHull& b, const btTransform& pose_b) {
  btVoronoiSimplexSolver simplex;
  btGjkEpaPenetrationDepthSolver penetration;
  btGjkPairDetector detector(&a, &b, &simplex, &penetration);
  btGjkPairDetector::ClosestPointInput input;
  input.m_transformA = pose_a;
  input.m_transformB = pose_b;
  btPointCollector output;
  detector.getClosestPoints(input, output, nullptr);
  return output.m_distance + a.getMargin() + b.getMargin();
}

TEST(FindSeparation, OfCubesFaceToFace) {
  const CellHull cube = Hull(testing::CubeCell(0.04));  // 4 units wide
  const auto apart = FindSeparation(cube, At({0, 0, 0}), cube, At({0, 5, 0}), 10, -1);
  EXPECT_NEAR(apart.distance, 1, 1e-3);
  EXPECT_NEAR(apart.normal.y(), -1, 1e-4);  // from b to a
  EXPECT_EQ(apart.touch_count, 4);
  const auto inside = FindSeparation(cube, At({0, 0, 0}), cube, At({0.5, -3.5, 0.5}), 0.02F, -1);
  EXPECT_NEAR(inside.distance, -0.5, 1e-3);
  EXPECT_NEAR(inside.normal.y(), 1, 1e-4);
  EXPECT_GE(inside.touch_count, 1);
  for (int i = 0; i < inside.touch_count; ++i) EXPECT_NEAR(inside.touches[i].distance, -0.5, 1e-3);
}

/// Never farther apart than GJK's distance, nor less deep than EPA's depth, which no axis can be; and never a touch where there is none within
/// reach of what the left-out axes are worth.
TEST(FindSeparation, AgreesWithBulletsOwn) {
  const CellHull a = Hull(testing::LatticeCell(0.03));
  const CellHull b = Hull(testing::LatticeCell(0.035));
  base::Random random(7);
  double worst = 0;
  int touching = 0;
  for (int i = 0; i < 3000; ++i) {
    const btTransform pose_a = RandomPose(random, 0);
    const btTransform pose_b = RandomPose(random, 1.6);
    const float truth = GjkDistance(a, pose_a, b, pose_b);
    const Separation found = FindSeparation(a, pose_a, b, pose_b, 1000, -1);
    EXPECT_LE(found.distance, truth + 0.01) << i;
    if (truth < 0.02 && truth > -0.8) {
      ++touching;
      worst = std::max<double>(worst, truth - found.distance);
    }
  }
  EXPECT_GT(touching, 300);
  EXPECT_LT(worst, 0.25);  // units; the cells are 3 across
}

TEST(FindSeparation, TheAxisRememberedEndsTheSearch) {
  const CellHull cell = Hull(testing::LatticeCell(0.03));
  const Separation first = FindSeparation(cell, At({0, 0, 0}), cell, At({4, 0.5, 0.2}), 0.02F, -1);
  ASSERT_GT(first.distance, 0.02F);
  ASSERT_GE(first.axis, 0);
  const Separation again = FindSeparation(cell, At({0, 0, 0}), cell, At({4, 0.5, 0.2}), 0.02F, first.axis);
  EXPECT_EQ(again.axis, first.axis);
  EXPECT_NEAR(again.distance, first.distance, 1e-5);
  EXPECT_EQ(again.touch_count, 0);
}

TEST(FindSeparation, IsSymmetric) {
  const CellHull cell = Hull(testing::LatticeCell(0.03));
  base::Random random(3);
  for (int i = 0; i < 200; ++i) {
    const btTransform pose_a = RandomPose(random, 0.8);
    const btTransform pose_b = RandomPose(random, 0.8);
    const Separation ab = FindSeparation(cell, pose_a, cell, pose_b, 1000, -1);
    const Separation ba = FindSeparation(cell, pose_b, cell, pose_a, 1000, -1);
    EXPECT_NEAR(ab.distance, ba.distance, 1e-4);
  }
}

/// The grid finds every pair whose spheres and boxes meet: held to trying all.
TEST(NearPairBroadphase, FindsWhatTryingAllPairsFinds) {
  btDefaultCollisionConfiguration configuration;
  btCollisionDispatcher dispatcher(&configuration);
  NearPairBroadphase broadphase;
  const CellHull small = Hull(testing::CubeCell(0.02));
  const CellHull middle = Hull(testing::LatticeCell(0.03));
  const CellHull large = Hull(testing::CubeCell(0.5));
  btStaticPlaneShape plane(btVector3(0, 1, 0), 0);
  base::Random random(11);
  std::vector<std::unique_ptr<btCollisionObject>> objects;
  std::vector<btBroadphaseProxy*> proxies;
  const auto add = [&](btCollisionShape* shape, int group, int mask) {
    objects.push_back(std::make_unique<btCollisionObject>());
    objects.back()->setCollisionShape(shape);
    proxies.push_back(broadphase.createProxy({0, 0, 0}, {0, 0, 0}, shape->getShapeType(), objects.back().get(), group, mask, &dispatcher));
  };
  add(&plane, 1, 4);
  for (int i = 0; i < 400; ++i)
    add(const_cast<CellHull*>(i % 100 == 50 ? &large : i % 2 == 0 ? &small : &middle), i % 3 == 0 ? 2 : 4, i % 3 == 0 ? 4 : 7);
  for (int step = 0; step < 5; ++step) {
    for (std::size_t i = 0; i < objects.size(); ++i) {
      if (i > 0) objects[i]->setWorldTransform(RandomPose(random, step == 4 ? 1e6 : 8));
      btVector3 low, high;
      objects[i]->getCollisionShape()->getAabb(objects[i]->getWorldTransform(), low, high);
      broadphase.setAabb(proxies[i], low, high, &dispatcher);
    }
    broadphase.calculateOverlappingPairs(&dispatcher);
    std::set<std::pair<int, int>> found;
    const btBroadphasePairArray& pairs = broadphase.getOverlappingPairCache()->getOverlappingPairArray();
    for (int i = 0; i < pairs.size(); ++i) {
      EXPECT_TRUE(found.emplace(pairs[i].m_pProxy0->m_uniqueId, pairs[i].m_pProxy1->m_uniqueId).second) << "twice";
      if (i > 0) {
        EXPECT_LT(std::pair(pairs[i - 1].m_pProxy0->m_uniqueId, pairs[i - 1].m_pProxy1->m_uniqueId),
                  std::pair(pairs[i].m_pProxy0->m_uniqueId, pairs[i].m_pProxy1->m_uniqueId));
      }
    }
    int truly = 0;
    for (std::size_t i = 0; i < objects.size(); ++i) {
      for (std::size_t j = i + 1; j < objects.size(); ++j) {
        const auto& a = *proxies[i];
        const auto& b = *proxies[j];
        if ((a.m_collisionFilterGroup & b.m_collisionFilterMask) == 0 || (b.m_collisionFilterGroup & a.m_collisionFilterMask) == 0) continue;
        bool meet = true;
        for (int axis = 0; axis < 3; ++axis) meet = meet && a.m_aabbMin[axis] <= b.m_aabbMax[axis] && b.m_aabbMin[axis] <= a.m_aabbMax[axis];
        const auto radius = [](const btCollisionShape* shape) {
          float r = 0;
          if (shape->getShapeType() == STATIC_PLANE_PROXYTYPE) return 1e30F;
          const auto* hull = static_cast<const CellHull*>(shape);
          for (int p = 0; p < hull->getNumPoints(); ++p) r = std::max(r, hull->getUnscaledPoints()[p].length());
          return r + hull->getMargin();
        };
        const float distance = (objects[i]->getWorldTransform().getOrigin() - objects[j]->getWorldTransform().getOrigin()).length();
        const bool near = distance <= radius(objects[i]->getCollisionShape()) + radius(objects[j]->getCollisionShape());
        if (!meet || !near) continue;
        ++truly;
        EXPECT_TRUE(found.contains({a.m_uniqueId, b.m_uniqueId})) << i << " " << j;
      }
    }
    if (step < 4) {
      EXPECT_GT(truly, 100);
    }
    EXPECT_LT(static_cast<double>(found.size()), 1.5 * truly + 400);
  }
  for (btBroadphaseProxy* proxy : proxies) broadphase.destroyProxy(proxy, &dispatcher);
  EXPECT_EQ(broadphase.getOverlappingPairCache()->getNumOverlappingPairs(), 0);
}

}  // namespace
}  // namespace vorocast::simulation
