// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "services/base/status.h"
#include "services/geometry/simulated_take.h"
#include "services/simulation/cell_shapes.h"
#include "services/simulation/effect_settings.h"
#include "services/simulation/pendulum.h"
#include "services/simulation/recall.h"
#include "services/simulation/tracked_motion.h"

namespace vorocast::simulation {

/// A scene object with its place worked out. Its body is a ball or a box about the body's origin, or the mesh; what is drawn has its own frame.
struct SceneBody {
  enum class Motion : std::uint8_t {
    kFixed,   // never moves
    kLoose,   // held until start_s, then moves by physics
    kDriven,  // follows its swing or its path whatever it hits
  };
  std::string name;
  Motion motion = Motion::kLoose;
  std::optional<geometry::Vec3> box_half;  // metres; empty for a ball
  bool is_mesh = false;                    // `mesh` is what things collide with; a loose one as its convex hull
  double radius = 0;                       // of the ball
  double mass = 1;                         // kg
  Surface surface;
  BodyState start;
  double start_s = 0;

  geometry::Rigid3 body_from_object;  // object: the frame of `mesh` and of the stored poses
  geometry::TriangleMesh mesh;

  // Pendulums only.
  struct Hinge {
    geometry::Rigid3 world_from_pivot;  // x: where the ball goes at its first passage; y up; it turns about z
    double arm = 0;
    PendulumSwing swing;
  };
  std::optional<Hinge> hinge;

  // What is driven along key frames only.
  struct Path {
    Vector position;  // world
    Vector rotation_deg;
  };
  std::optional<Path> path;

  /// Where a driven body is at `time`.
  geometry::Rigid3 DrivenPose(double time) const;
  /// The state in which a loose body is let go at `time`, the first step's at or after start_s: `start`, or a pendulum's in its swing.
  BodyState StateWhenLoose(double time) const;
};

struct Scene {
  std::optional<double> ground_height;
  geometry::Vec3 take_origin = geometry::Vec3::Zero();  // on the ground under the middle of the first frame
  std::vector<SceneBody> bodies;
};

/// Places ground and objects for a take. INVALID_ARGUMENT for a pendulum without gravity.
absl::StatusOr<Scene> MakeScene(const Effect& effect, const geometry::Cells& cells, const TrackedMotion& motion);

/// The lowest point that any cell's corner reaches at any frame, metres.
double LowestPoint(const geometry::Cells& cells, const TrackedMotion& motion);

}  // namespace vorocast::simulation
