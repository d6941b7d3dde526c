// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "services/simulation/cell_graph.h"
#include "services/simulation/key_framed.h"
#include "services/simulation/mask.h"
#include "services/simulation/recall.h"

namespace vorocast::simulation {

/// Soft constraints between neighbouring cells, which the paper's section 7 names as the way to soft bodies.
struct BondSettings {
  enum class Between : std::uint8_t { kNone, kReleased, kAll };
  Between between = Between::kNone;
  Scalar stiffness_s2 = 4000;
  Scalar damping_ratio = 0.3;
  std::optional<Scalar> break_stretch;
  MaskSettings mask;
};

/// A damped spring between each two neighbours, from the middle of their shared face on one to the same point on the other. All are
/// solved together, implicitly, on the velocities of a step: sequential impulses with a compliance, so that no stiffness is too stiff for the step
/// and momentum is kept exactly. A bond that is stretched too far breaks for good.
///
/// While both cells are recalled, a bond is at rest where the performer's motion puts them. When one is let go, the bond keeps the rest that
/// it had then.
class Bonds {
 public:
  /// A cell for one step, in its own frame (tracked_motion.h).
  struct Body {
    enum class State : std::uint8_t { kOnTarget, kRecalled, kReleased, kAsleep, kGone };
    State state = State::kOnTarget;
    geometry::Vec3 position = geometry::Vec3::Zero();
    geometry::Quat rotation = geometry::Quat::Identity();
    geometry::Vec3 velocity = geometry::Vec3::Zero();  // for the coming step; Solve changes these two
    geometry::Vec3 angular_velocity = geometry::Vec3::Zero();
    double inverse_mass = 0;     // 0: nothing moves it
    double inverse_inertia = 0;  // of a ball; the bonds hold many sides of a cell, so its axes do not matter
    geometry::Rigid3 target;     // where the performer's motion has it, and how it moves there
    geometry::Vec3 target_velocity = geometry::Vec3::Zero();
    geometry::Vec3 target_angular_velocity = geometry::Vec3::Zero();
  };

  Bonds(const BondSettings& settings, const geometry::Cells& cells, const MaskSubject& subject);

  bool empty() const { return bonds_.empty(); }
  /// Cells that hold each other do not collide. [n], unbroken bonds only.
  const std::vector<std::vector<std::int32_t>>& partners() const { return partners_; }
  std::size_t broken_count() const { return broken_count_; }
  /// Cells on target that a bond pulls at, so that they cannot be taken to stay there.
  std::vector<std::size_t> PulledOff(const std::vector<Body>& bodies) const;
  void Solve(double time, double dt, std::vector<Body>& bodies);

 private:
  struct Bond {
    std::int32_t a, b;
    geometry::Vec3 on_a, on_b;  // the face's middle in the cells' frames, once the bond has been let go
    double length;              // between the centroids
    double weight;
    bool loose = false;  // one of the two has been let go
    bool broken = false;
    geometry::Vec3 impulse = geometry::Vec3::Zero();  // of the last step, to start the next from
  };
  /// A bond as a step sees it.
  struct Row {
    std::size_t bond;
    geometry::Vec3 arm_a, arm_b;
    geometry::Mat3 mass;  // of the soft constraint
    geometry::Vec3 bias;  // velocity that closes the gap
    double softness;
  };
  struct Gap {
    geometry::Vec3 arm_a, arm_b, gap;  // arms from the centroids, in the world
  };
  Gap Measure(const Bond& bond, const std::vector<Body>& bodies) const;
  void Break(Bond& bond);

  const BondSettings& settings_;
  std::vector<Bond> bonds_;
  std::vector<geometry::Vec3> face_;  // [bonds] from a's centroid; b's is this plus a − b
  std::vector<geometry::Vec3> from_b_;
  std::vector<std::vector<std::int32_t>> partners_;
  std::vector<Row> rows_;
  std::size_t broken_count_ = 0;
};

}  // namespace vorocast::simulation
