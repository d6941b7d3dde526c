// SPDX-License-Identifier: AGPL-3.0-or-later
#include "services/simulation/world.h"

#include <BulletDynamics/ConstraintSolver/btHingeConstraint.h>
#include <btBulletDynamicsCommon.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "services/base/check.h"
#include "services/simulation/cell_collision.h"
#include "services/simulation/near_pairs.h"
#include "services/simulation/object_surface.h"

namespace vorocast::simulation {
namespace {

using geometry::Quat;
using geometry::Rigid3;
using geometry::Vec3;

constexpr double kUnits = 100;  // Bullet units (centimetres) a metre
constexpr int kSolverIterations = 8;
constexpr float kAngularDamping = 0.2F;  // of released cells, so that a pile comes to rest
constexpr float kSleepSpeed = 4;         // centimetres a second
constexpr float kSleepTurn = 1;          // radians a second

enum Group : int { kGround = 1, kRecalledCell = 2, kReleasedCell = 4, kObject = 8 };

btVector3 ToBullet(const Vec3& v) { return {static_cast<float>(v.x()), static_cast<float>(v.y()), static_cast<float>(v.z())}; }
btVector3 LengthToBullet(const Vec3& v) { return ToBullet(kUnits * v); }
Vec3 FromBullet(const btVector3& v) { return {v.x(), v.y(), v.z()}; }
btQuaternion ToBullet(const Quat& q) {
  return {static_cast<float>(q.x()), static_cast<float>(q.y()), static_cast<float>(q.z()), static_cast<float>(q.w())};
}
btTransform ToBullet(const Vec3& position, const Quat& rotation) { return btTransform(ToBullet(rotation), LengthToBullet(position)); }

/// Body frame to cell frame and back: `cell_from_body` has no translation.
BodyState StateOf(const btRigidBody& body, const Quat& cell_from_body) {
  const btQuaternion q = body.getOrientation();
  const Quat world_from_body = Quat(q.w(), q.x(), q.y(), q.z()).normalized();
  return {.position = FromBullet(body.getWorldTransform().getOrigin()) / kUnits,
          .rotation = world_from_body * cell_from_body.conjugate(),
          .velocity = FromBullet(body.getLinearVelocity()) / kUnits,
          .angular_velocity = FromBullet(body.getAngularVelocity())};
}

void PlaceBody(btRigidBody& body, const BodyState& state, const Quat& cell_from_body) {
  const btTransform pose = ToBullet(state.position, state.rotation * cell_from_body);
  body.setWorldTransform(pose);
  body.setInterpolationWorldTransform(pose);
  body.setLinearVelocity(LengthToBullet(state.velocity));
  body.setAngularVelocity(ToBullet(state.angular_velocity));
  body.setInterpolationLinearVelocity(body.getLinearVelocity());
  body.setInterpolationAngularVelocity(body.getAngularVelocity());
}

/// Bullet takes a kinematic body's velocity from where it was before, and finds contacts where it is now: with cells, which are where the step
/// begins. So it is left there as well, and told that it was before where it comes to be at `next` by the same motion again.
void AimKinematic(btRigidBody& body, const btTransform& next) {
  const btTransform now = body.getWorldTransform();
  const btMatrix3x3 turn = next.getBasis() * now.getBasis().transpose();
  body.setInterpolationWorldTransform(btTransform(turn.transpose() * now.getBasis(), 2 * now.getOrigin() - next.getOrigin()));
}

void SetSurface(btRigidBody& body, const Surface& surface) {
  body.setFriction(static_cast<float>(surface.friction));
  body.setRestitution(static_cast<float>(surface.restitution));
}

struct CellBody {
  std::unique_ptr<CellHull> shape;
  std::unique_ptr<btRigidBody> body;
  Quat cell_from_body;
  float mass = 0;
  btVector3 inertia;
  float resistance = 1;  // the body has mass × resistance now, and likewise
  float angular_resistance = 1;
  bool inside = false;
  bool released = false;
};

void SetMass(CellBody& cell, double resistance, double angular_resistance) {
  const auto linear = static_cast<float>(resistance);
  const auto angular = static_cast<float>(angular_resistance);
  if (cell.resistance == linear && cell.angular_resistance == angular) return;
  cell.resistance = linear;
  cell.angular_resistance = angular;
  cell.body->setMassProps(cell.mass * linear, cell.inertia * angular);
  cell.body->updateInertiaTensor();
}

struct ObjectBody {
  std::unique_ptr<btTriangleMesh> triangles;  // outlives the shape
  std::unique_ptr<btCollisionShape> shape;
  std::unique_ptr<btRigidBody> body;
  std::unique_ptr<btHingeConstraint> hinge;
  double mass = 0;
  double arm = 0;  // of a pendulum, metres
  bool driven = false;
  btTransform next;  // where the coming step takes a driven one
};

}  // namespace

namespace {

/// What a loose mesh collides as: its convex hull, thinned out as a cell's.
std::unique_ptr<btCollisionShape> MakeHullShape(const geometry::TriangleMesh& mesh) {
  CellShape shape;
  shape.all_corners = mesh.vertices;
  shape.hull = ThinOutCorners(mesh.vertices);
  for (const Vec3& corner : shape.hull) shape.radius = std::max(shape.radius, corner.norm() + kHullMargin);
  return std::make_unique<CellHull>(shape, static_cast<float>(kUnits));
}

std::unique_ptr<btCollisionShape> MakeObjectShape(const SceneBody& body, std::unique_ptr<btTriangleMesh>& triangles) {
  if (body.is_mesh && body.motion == SceneBody::Motion::kLoose) return MakeHullShape(body.mesh);
  if (body.is_mesh) {
    triangles = std::make_unique<btTriangleMesh>();
    const auto corner = [&](std::int32_t v) { return LengthToBullet(body.mesh.vertices[static_cast<std::size_t>(v)]); };
    for (const auto& triangle : body.mesh.triangles) triangles->addTriangle(corner(triangle[0]), corner(triangle[1]), corner(triangle[2]));
    auto shape = std::make_unique<btBvhTriangleMeshShape>(triangles.get(), true);
    shape->setMargin(static_cast<float>(kUnits * kHullMargin));
    return shape;
  }
  if (body.box_half) {
    auto box = std::make_unique<btBoxShape>(LengthToBullet(*body.box_half));
    box->setMargin(static_cast<float>(kUnits * kHullMargin));
    return box;
  }
  return std::make_unique<btSphereShape>(static_cast<float>(kUnits * body.radius));
}

}  // namespace

struct World::Bodies {
  btDefaultCollisionConfiguration configuration;
  CellCollision::Factory cell_collisions;
  CellPlaneCollision::Factory cell_plane_collisions;
  CellPlaneCollision::Factory plane_cell_collisions;
  btCollisionDispatcher dispatcher{&configuration};
  NearPairBroadphase broadphase;
  btSequentialImpulseConstraintSolver solver;
  btDiscreteDynamicsWorld world{&dispatcher, &broadphase, &solver, &configuration};
  std::unique_ptr<btStaticPlaneShape> ground_shape;
  std::unique_ptr<btRigidBody> ground;
  std::vector<CellBody> cells;
  std::vector<ObjectBody> objects;
  btVector3 gravity{0, 0, 0};
  // Where the step at hand began, world.
  std::vector<btVector3> centres_before;    // [n] of cells
  std::vector<btTransform> objects_before;  // [m]

  void RememberPlaces() {
    if (objects.empty()) return;
    objects_before.clear();
    for (const ObjectBody& object : objects) objects_before.push_back(object.body->getWorldTransform());
    centres_before.resize(cells.size());
    for (std::size_t c = 0; c < cells.size(); ++c) centres_before[c] = cells[c].body->getWorldTransform().getOrigin();
  }

  void HoldOutOfObjects(double dt) {
    for (std::size_t i = 0; i < objects.size(); ++i) {
      const ObjectSurface surface(*objects[i].body, objects_before[i], static_cast<float>(dt));
      for (std::size_t c = 0; c < cells.size(); ++c) {
        if (cells[c].inside && cells[c].released) surface.HoldOut(*cells[c].body, centres_before[c], cells[c].shape->inner_radius);
      }
    }
  }

  double in_ground = 0;  // metres, the deepest that a cell was left below the ground

  /// What Bullet's contacts leave undone for cells on the ground. A few iterations cannot carry a heap on a light cell: what is left below
  /// the ground is put back on it. And lumps are not balls: their corners take the turning out of them, or they would roll away for ever.
  void SettleOnGround(double dt) {
    constexpr float kSlop = 0.1F;           // Bullet units that contacts may work with
    constexpr double kRollingDecay = 25.0;  // 1/s
    const auto kept_turning = static_cast<float>(std::exp(-kRollingDecay * dt));
    const float ground_height = ground_shape->getPlaneConstant();
    in_ground = 0;
    for (CellBody& cell : cells) {
      if (!cell.inside || !cell.released || !cell.body->isActive()) continue;
      const btTransform& pose = cell.body->getWorldTransform();
      if (pose.getOrigin().y() - cell.shape->radius > ground_height + kSlop) continue;
      float lowest = std::numeric_limits<float>::max();
      const btVector3& up = pose.getBasis()[1];
      for (const Eigen::Vector3f& corner : cell.shape->all_corners)
        lowest = std::min(lowest, up.x() * corner.x() + up.y() * corner.y() + up.z() * corner.z());
      const float above = pose.getOrigin().y() + lowest - ground_height;
      if (above > kSlop) continue;
      cell.body->setAngularVelocity(kept_turning * cell.body->getAngularVelocity());
      const float lift = -kSlop - above;
      in_ground = std::max(in_ground, std::min(kSlop, -above) / kUnits);
      if (lift <= 0) continue;
      btTransform lifted = pose;
      lifted.getOrigin().setY(pose.getOrigin().y() + lift);
      cell.body->setWorldTransform(lifted);
      cell.body->setInterpolationWorldTransform(lifted);
      btVector3 velocity = cell.body->getLinearVelocity();
      velocity.setY(std::max(velocity.y(), 0.0F));
      cell.body->setLinearVelocity(velocity);
    }
  }

  ~Bodies() {
    for (ObjectBody& object : objects) {
      if (object.hinge) world.removeConstraint(object.hinge.get());
      world.removeRigidBody(object.body.get());
    }
    for (CellBody& cell : cells) {
      if (cell.inside) world.removeRigidBody(cell.body.get());
    }
    if (ground) world.removeRigidBody(ground.get());
  }
};

World::World(double gravity, std::optional<double> ground_height, const Surface& ground) : bodies_(std::make_unique<Bodies>()) {
  Bodies& b = *bodies_;
  b.gravity = LengthToBullet(Vec3(0, -gravity, 0));
  b.world.setGravity(b.gravity);
  b.dispatcher.registerCollisionCreateFunc(CONVEX_HULL_SHAPE_PROXYTYPE, CONVEX_HULL_SHAPE_PROXYTYPE, &b.cell_collisions);
  b.plane_cell_collisions.m_swapped = true;
  b.dispatcher.registerCollisionCreateFunc(CONVEX_HULL_SHAPE_PROXYTYPE, STATIC_PLANE_PROXYTYPE, &b.cell_plane_collisions);
  b.dispatcher.registerCollisionCreateFunc(STATIC_PLANE_PROXYTYPE, CONVEX_HULL_SHAPE_PROXYTYPE, &b.plane_cell_collisions);
  b.configuration.setPlaneConvexMultipointIterations();
  b.world.setForceUpdateAllAabbs(false);
  b.world.getDispatchInfo().m_useContinuous = false;
  b.world.getSolverInfo().m_numIterations = kSolverIterations;
  b.solver.setRandSeed(0);
  if (!ground_height) return;
  b.ground_shape = std::make_unique<btStaticPlaneShape>(btVector3(0, 1, 0), static_cast<float>(kUnits * *ground_height));
  b.ground = std::make_unique<btRigidBody>(btRigidBody::btRigidBodyConstructionInfo(0, nullptr, b.ground_shape.get()));
  SetSurface(*b.ground, ground);
  b.world.addRigidBody(b.ground.get(), kGround, kReleasedCell | kObject);
}

World::~World() = default;

void World::AddCells(const std::vector<CellShape>& shapes, const Surface& surface) {
  for (const CellShape& shape : shapes) {
    CellBody cell;
    cell.cell_from_body = shape.cell_from_body;
    cell.shape = std::make_unique<CellHull>(shape, static_cast<float>(kUnits));
    cell.mass = static_cast<float>(shape.mass);
    cell.inertia = ToBullet(kUnits * kUnits * shape.inertia);
    const btRigidBody::btRigidBodyConstructionInfo info(cell.mass, nullptr, cell.shape.get(), cell.inertia);
    cell.body = std::make_unique<btRigidBody>(info);
    // Gyroscopic torque is nothing to see on lumps, and a recalled cell's rotation is not Bullet's to change.
    cell.body->setFlags(BT_DISABLE_WORLD_GRAVITY);
    cell.body->setSleepingThresholds(kSleepSpeed, kSleepTurn);
    SetSurface(*cell.body, surface);
    cell.body->setUserIndex(static_cast<int>(bodies_->cells.size()));
    bodies_->cells.push_back(std::move(cell));
  }
}

void World::AddObject(const SceneBody& scene_body) {
  ObjectBody object;
  object.mass = scene_body.mass;
  object.arm = scene_body.hinge ? scene_body.hinge->arm : 0;
  object.driven = scene_body.motion == SceneBody::Motion::kDriven;
  object.shape = MakeObjectShape(scene_body, object.triangles);
  // Held objects and fixed ones have no mass until they are let go.
  object.body = std::make_unique<btRigidBody>(btRigidBody::btRigidBodyConstructionInfo(0, nullptr, object.shape.get()));
  PlaceBody(*object.body, {.position = scene_body.start.position, .rotation = scene_body.start.rotation}, Quat::Identity());
  object.next = object.body->getWorldTransform();
  object.body->setDamping(0, 0);
  SetSurface(*object.body, scene_body.surface);
  if (object.driven) {
    object.body->setCollisionFlags(object.body->getCollisionFlags() | btCollisionObject::CF_KINEMATIC_OBJECT);
    object.body->setActivationState(DISABLE_DEACTIVATION);
  }
  bodies_->world.addRigidBody(object.body.get(), kObject, kGround | kRecalledCell | kReleasedCell | kObject);
  bodies_->objects.push_back(std::move(object));
}

void World::LetPartnersOverlap(const std::vector<std::vector<std::int32_t>>* partners) { bodies_->broadphase.LetPartnersOverlap(partners); }

void World::Enter(std::size_t index, Role role, const BodyState& state) {
  CellBody& cell = bodies_->cells[index];
  PlaceBody(*cell.body, state, cell.cell_from_body);
  cell.body->clearForces();
  const bool recalled = role == Role::kRecalled;
  cell.released = !recalled;
  SetMass(cell, 1, 1);
  cell.body->setDamping(0, recalled ? 0 : kAngularDamping);
  cell.body->setGravity(recalled ? btVector3(0, 0, 0) : bodies_->gravity);
  cell.body->forceActivationState(recalled ? DISABLE_DEACTIVATION : ACTIVE_TAG);
  cell.body->setDeactivationTime(0);
  const int group = recalled ? kRecalledCell : kReleasedCell;
  const int others = recalled ? kReleasedCell | kObject : kGround | kRecalledCell | kReleasedCell | kObject;
  if (cell.inside) {
    // The broadphase asks for the filter anew at every step.
    cell.body->getBroadphaseHandle()->m_collisionFilterGroup = group;
    cell.body->getBroadphaseHandle()->m_collisionFilterMask = others;
  } else {
    bodies_->world.addRigidBody(cell.body.get(), group, others);
    cell.inside = true;
  }
}

void World::Leave(std::size_t index) {
  CellBody& cell = bodies_->cells[index];
  if (cell.inside) bodies_->world.removeRigidBody(cell.body.get());
  cell.inside = false;
}

bool World::Contains(std::size_t index) const { return bodies_->cells[index].inside; }

void World::SetVelocity(std::size_t index, const Push& push) {
  CellBody& cell = bodies_->cells[index];
  SetMass(cell, push.resistance, push.angular_resistance);
  cell.body->setLinearVelocity(LengthToBullet(push.velocity));
  cell.body->setAngularVelocity(ToBullet(push.angular_velocity));
}

void World::SetReleasedVelocity(std::size_t index, const Vec3& velocity, const Vec3& angular_velocity) {
  CellBody& cell = bodies_->cells[index];
  cell.body->setLinearVelocity(LengthToBullet(velocity));
  cell.body->setAngularVelocity(ToBullet(angular_velocity));
  if (!cell.body->isActive()) cell.body->activate();
}

void World::SetGravity(double gravity) {
  const btVector3 next = LengthToBullet(Vec3(0, -gravity, 0));
  if (next == bodies_->gravity) return;
  bodies_->gravity = next;
  bodies_->world.setGravity(next);
  for (CellBody& cell : bodies_->cells) {
    if (!cell.inside || !cell.released) continue;
    cell.body->setGravity(next);
    cell.body->activate();
  }
  for (ObjectBody& object : bodies_->objects) object.body->activate();
}

BodyState World::State(std::size_t index) const {
  const CellBody& cell = bodies_->cells[index];
  return StateOf(*cell.body, cell.cell_from_body);
}

bool World::Sleeps(std::size_t index) const { return !bodies_->cells[index].body->isActive(); }

void World::Drive(std::size_t index, const Rigid3& world_from_body) {
  ObjectBody& object = bodies_->objects[index];
  VOROCAST_CHECK(object.driven);
  object.next = ToBullet(world_from_body.translation, world_from_body.rotation);
}

void World::Loosen(std::size_t index, const BodyState& state) {
  ObjectBody& object = bodies_->objects[index];
  bodies_->world.removeRigidBody(object.body.get());
  btVector3 inertia;
  object.shape->calculateLocalInertia(static_cast<float>(object.mass), inertia);
  object.body->setMassProps(static_cast<float>(object.mass), inertia);
  object.body->setFlags(0);
  PlaceBody(*object.body, state, Quat::Identity());
  object.body->forceActivationState(object.arm > 0 ? DISABLE_DEACTIVATION : ACTIVE_TAG);
  object.body->setSleepingThresholds(kSleepSpeed, kSleepTurn);
  bodies_->world.addRigidBody(object.body.get(), kObject, kGround | kRecalledCell | kReleasedCell | kObject);
  if (object.arm > 0) {
    const btVector3 pivot_in_body(0, static_cast<float>(kUnits * object.arm), 0);
    object.hinge = std::make_unique<btHingeConstraint>(*object.body, pivot_in_body, btVector3(0, 0, 1));
    bodies_->world.addConstraint(object.hinge.get());
  }
}

BodyState World::ObjectState(std::size_t index) const { return StateOf(*bodies_->objects[index].body, Quat::Identity()); }

geometry::Box3 World::ObjectBounds(std::size_t index) const {
  btVector3 low;
  btVector3 high;
  bodies_->objects[index].body->getAabb(low, high);
  return {FromBullet(low) / kUnits, FromBullet(high) / kUnits};
}

void World::Step(double dt) {
  bodies_->cell_collisions.overlaps = {};
  bodies_->broadphase.LookAhead(dt);
  for (ObjectBody& object : bodies_->objects) {
    if (object.driven) AimKinematic(*object.body, object.next);
  }
  bodies_->RememberPlaces();
  bodies_->world.stepSimulation(static_cast<float>(dt), 0);
  for (ObjectBody& object : bodies_->objects) {
    if (object.driven) object.body->setWorldTransform(object.next);
  }
  bodies_->HoldOutOfObjects(dt);
  if (bodies_->ground) bodies_->SettleOnGround(dt);
}

World::Penetration World::DeepestPenetration() const {
  const CellOverlaps& overlaps = bodies_->cell_collisions.overlaps;
  Penetration deepest{.cells = overlaps.pressed / kUnits, .begun = overlaps.begun / kUnits, .ground = bodies_->in_ground};
  const btDispatcher& dispatcher = bodies_->dispatcher;
  for (int m = 0; m < dispatcher.getNumManifolds(); ++m) {
    const btPersistentManifold& manifold = *bodies_->dispatcher.getManifoldByIndexInternal(m);
    const int groups =
        manifold.getBody0()->getBroadphaseHandle()->m_collisionFilterGroup | manifold.getBody1()->getBroadphaseHandle()->m_collisionFilterGroup;
    if ((groups & kGround) != 0 || (groups & kObject) == 0 || (groups & (kRecalledCell | kReleasedCell)) == 0) continue;
    for (int i = 0; i < manifold.getNumContacts(); ++i)
      deepest.objects = std::max(deepest.objects, -static_cast<double>(manifold.getContactPoint(i).getDistance()) / kUnits);
  }
  return deepest;
}

}  // namespace vorocast::simulation
