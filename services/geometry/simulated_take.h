// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "services/geometry/tracked_take.h"
#include "services/geometry/triangle_mesh.h"

namespace vorocast::geometry {

enum class CellState : std::uint8_t {
  kRecalled = 0,  // held to its tracked pose by the recall spring
  kReleased = 1,  // moved by gravity and contacts alone
  kGone = 2,      // no longer in the scene
};

/// A scene object that is no cell (pendulum, box, sphere, ground): its shape in its own frame and its pose at every step.
struct SceneObject {
  std::string name;
  TriangleMesh mesh;
};

/// One effect run on a tracked take: the content of simulated.h5 (docs/storage_format.md). S stored instants, n cells, m objects.
/// Cells keep their template shapes; poses are world_from_template, as in tracked.h5.
struct SimulatedTake {
  std::string effect_json;                     // the effect as it was run, defaults filled in
  std::vector<double> time;                    // [S] seconds from the take's first frame
  std::vector<Eigen::Vector4f> cell_rotation;  // [S*n] w x y z
  std::vector<Vec3> cell_translation;          // [S*n]
  std::vector<CellState> cell_state;           // [S*n]
  std::vector<SceneObject> objects;            // [m]
  std::vector<Rigid3> object_pose;             // [S*m] world_from_object
};

}  // namespace vorocast::geometry
