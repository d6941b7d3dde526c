// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include "services/geometry/rigid3.h"
#include "services/geometry/triangle_mesh.h"

namespace vorocast::synth {

/// A bird cage with its bird, closed and in one piece, every bar at least 25 mm thick. The origin is where its string is held; it hangs below.
/// The string is no part of it: depth cameras do not see anything that thin.
geometry::TriangleMesh MakeCage(double cell_m);

/// The cage as a damped pendulum of two angles hung from a moving hand, turning with whoever holds it. Steps of fixed length.
class SwingingCage {
 public:
  /// Hangs still at `seconds`.
  explicit SwingingCage(double seconds);
  /// Lets it swing until `seconds`.
  void AdvanceTo(double seconds);
  /// Where it is at `seconds`, which should be the time it was last advanced to.
  geometry::Rigid3 WorldFromCage(double seconds) const;

 private:
  void Step();

  std::int64_t step_ = 0;
  geometry::Vec3 position_, velocity_;  // of the middle of its mass
};

}  // namespace vorocast::synth
