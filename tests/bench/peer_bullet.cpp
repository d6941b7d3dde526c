// SPDX-License-Identifier: AGPL-3.0-or-later
#include "tests/bench/peer_bullet.h"

#include <btBulletDynamicsCommon.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <set>
#include <vector>

#include "tests/bench/bench_report.h"

namespace vorocast::bench {
namespace {

constexpr float kStep_s = 1.0F / 240;
constexpr float kSpring = 1000;  // s⁻², critically damped
constexpr float kDensity = 1000;

btVector3 ToBullet(const geometry::Vec3& x) { return {static_cast<float>(x.x()), static_cast<float>(x.y()), static_cast<float>(x.z())}; }

std::unique_ptr<btConvexHullShape> HullOf(const geometry::Cells& cells, std::size_t c) {
  auto hull = std::make_unique<btConvexHullShape>();
  std::set<std::int32_t> corners;
  for (auto f = static_cast<std::size_t>(cells.face_offset[c]); f < static_cast<std::size_t>(cells.face_offset[c + 1]); ++f) {
    for (auto i = cells.vertex_offset[f]; i < cells.vertex_offset[f + 1]; ++i) corners.insert(cells.vertex[static_cast<std::size_t>(i)]);
  }
  for (const std::int32_t v : corners) hull->addPoint(ToBullet(cells.vertices[static_cast<std::size_t>(v)] - cells.centroid[c]), false);
  hull->recalcLocalAabb();
  return hull;
}

}  // namespace

BulletSteps StepWithBullet(const geometry::Cells& cells, int steps) {
  btDefaultCollisionConfiguration configuration;
  btCollisionDispatcher dispatcher(&configuration);
  btDbvtBroadphase broadphase;
  btSequentialImpulseConstraintSolver solver;
  btDiscreteDynamicsWorld world(&dispatcher, &broadphase, &solver, &configuration);
  world.setGravity({0, -9.81F, 0});
  std::vector<std::unique_ptr<btConvexHullShape>> shapes;
  std::vector<std::unique_ptr<btRigidBody>> bodies;
  for (std::size_t c = 0; c < cells.size(); ++c) {
    shapes.push_back(HullOf(cells, c));
    const float mass = kDensity * static_cast<float>(cells.volume[c]);
    btVector3 inertia;
    shapes.back()->calculateLocalInertia(mass, inertia);
    btRigidBody::btRigidBodyConstructionInfo info(mass, nullptr, shapes.back().get(), inertia);
    info.m_startWorldTransform.setOrigin(ToBullet(cells.centroid[c]));
    bodies.push_back(std::make_unique<btRigidBody>(info));
    world.addRigidBody(bodies.back().get());
  }
  const double begin = CpuSeconds();
  for (int step = 0; step < steps; ++step) {
    for (std::size_t c = 0; c < cells.size(); ++c) {
      btRigidBody& body = *bodies[c];
      const btVector3 away = ToBullet(cells.centroid[c]) - body.getWorldTransform().getOrigin();
      body.applyCentralForce(body.getMass() * (kSpring * away - 2 * std::sqrt(kSpring) * body.getLinearVelocity()));
    }
    world.stepSimulation(kStep_s, 0);
  }
  BulletSteps result{(CpuSeconds() - begin) / steps, 0};
  for (std::size_t c = 0; c < cells.size(); ++c) {
    const btVector3 away = ToBullet(cells.centroid[c]) - bodies[c]->getWorldTransform().getOrigin();
    result.drift_max_m = std::max(result.drift_max_m, static_cast<double>(away.length()));
    world.removeRigidBody(bodies[c].get());
  }
  return result;
}

}  // namespace vorocast::bench
