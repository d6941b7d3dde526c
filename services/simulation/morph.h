// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <cstdint>
#include <vector>

#include "services/geometry/simulated_take.h"
#include "services/simulation/key_framed.h"
#include "services/simulation/tracked_motion.h"

namespace vorocast::simulation {

/// Morphing between two tracked takes (paper, section 6.3): each cell of the source turns into one of the target, at a time of its own.
struct MorphSettings {
  enum class Order : std::uint8_t { kOutsideIn, kInsideOut, kTopDown, kBottomUp, kTogether };
  Order order = Order::kOutsideIn;  // in which the source's cells go
  double start_s = 0.5;
  double end_s = 2;           // when the last cell has arrived
  double cell_s = 0.6;        // how long one cell takes
  double target_start_s = 0;  // the target's own time at the effect's time 0
  double order_weight_m = 0;  // 0: cells go where it is nearest. More: a cell that goes late takes a place deep inside, as in the paper
};

/// Which cell becomes which. Of unequal counts, the smaller side's cells all have one partner, chosen so that the sum of squared ways is the least
/// there is; what is left over on the other side starts from, or ends in, nothing at the nearest cell that has one.
struct MorphPair {
  std::int32_t source = -1;  // −1: grows from nothing at `at`
  std::int32_t target = -1;  // −1: shrinks to nothing at `at`
  std::int32_t at = -1;      // index of the pair that it comes from or goes to
  double start_s = 0;
};
std::vector<MorphPair> MatchCells(const MorphSettings& settings, const TrackedMotion& source, const TrackedMotion& target);

/// A convex polyhedron that turns into another: corner i goes straight from `from[i]` to `to[i]`. At every blend in between it is the Minkowski sum
/// (1−t) A ⊕ t B, convex and without a fold: smoother than merging the two on a sphere (the paper's [kent92]), where corners of one are stretched
/// over faces of the other. Its faces never change, so one list of triangles holds for all blends.
struct ConvexMorph {
  std::vector<geometry::Vec3> from, to;
  std::vector<std::array<std::int32_t, 3>> triangles;

  std::vector<geometry::Vec3> At(double blend) const;
  double Volume(double blend) const;
};
/// The hulls of both corner lists, each about the origin. A list of less than four corners, or without volume, stands for the origin.
ConvexMorph BlendHulls(const std::vector<geometry::Vec3>& from, const std::vector<geometry::Vec3>& to);

/// Turns the simulated source into the target: fills result.morph, and has each cell of the source gone from where it begins to change.
void AddMorph(const MorphSettings& settings, const TrackedMotion& source, const TrackedMotion& target, geometry::SimulatedTake& result);

}  // namespace vorocast::simulation
