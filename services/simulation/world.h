// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <memory>
#include <vector>

#include "services/simulation/cell_shapes.h"
#include "services/simulation/scene.h"

namespace vorocast::simulation {

/// The rigid bodies that may touch each other now, in Bullet. Lengths are metres here and centimetres inside, where Bullet's tolerances
/// fit cells of a few centimetres.
///
/// Cells are in the world or out of it: what cannot touch anything costs nothing. Recalled cells never collide with each other nor with
/// the ground; everything else does. Without threads, clocks and random order, so the same calls give the same bits.
class World {
 public:
  enum class Role : std::uint8_t { kRecalled, kReleased };

  World(double gravity, std::optional<double> ground_height, const Surface& ground);
  ~World();
  World(const World&) = delete;
  World& operator=(const World&) = delete;

  void AddCells(const std::vector<CellShape>& shapes, const Surface& surface);
  void AddObject(const SceneBody& body);
  /// Cells that never collide with each other, [n] lists or none; outlives the world and may change between steps.
  void LetPartnersOverlap(const std::vector<std::vector<std::int32_t>>* partners);

  /// Puts a cell into the world, or changes its role there.
  void Enter(std::size_t cell, Role role, const BodyState& state);
  void Leave(std::size_t cell);
  bool Contains(std::size_t cell) const;
  /// A recalled cell's velocities for the coming step, and how much harder than by its mass it is to push in it (recall.h).
  struct Push {
    geometry::Vec3 velocity;
    geometry::Vec3 angular_velocity;
    double resistance = 1;
    double angular_resistance = 1;
  };
  void SetVelocity(std::size_t cell, const Push& push);
  /// A released cell's velocities, changed from outside; it wakes if it sleeps.
  void SetReleasedVelocity(std::size_t cell, const geometry::Vec3& velocity, const geometry::Vec3& angular_velocity);
  /// Wakes everything when it changes.
  void SetGravity(double gravity);
  /// In the cell's frame (template axes). The cell is in the world.
  BodyState State(std::size_t cell) const;
  /// Whether the cell lies still and is left out of the computation until something touches it.
  bool Sleeps(std::size_t cell) const;

  /// Moves a driven object to where it is at the end of the coming step.
  void Drive(std::size_t object, const geometry::Rigid3& world_from_body);
  /// Lets a held loose object go, in the given state.
  void Loosen(std::size_t object, const BodyState& state);
  BodyState ObjectState(std::size_t object) const;
  geometry::Box3 ObjectBounds(std::size_t object) const;

  void Step(double dt);

  /// How deep things were in each other at the last step's collision detection, metres; of the ground, what was left after the step.
  struct Penetration {
    double cells = 0;    // of two cells: how much deeper than when they began to collide, or at any time since
    double begun = 0;    // of two cells that were in each other when they began to collide
    double objects = 0;  // of a cell in an object
    double ground = 0;   // of a cell in the ground
  };
  Penetration DeepestPenetration() const;

 private:
  struct Bodies;
  std::unique_ptr<Bodies> bodies_;
};

}  // namespace vorocast::simulation
