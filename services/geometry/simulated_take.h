// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <array>
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

/// Cells that are there once more, beside the take's own (time persistence, paper section 6.2): K rows, those of an instant together, in the order
/// of copies and then of cells. Each has the shape of a template cell and a pose of its own.
struct CellCopies {
  std::vector<std::int64_t> offset;       // [S+1] rows offset[s] … offset[s+1]−1 are those of instant s; empty: there are no copies at all
  std::vector<std::int32_t> copy;         // [K] which copy it belongs to
  std::vector<std::int32_t> cell;         // [K] whose shape it has
  std::vector<Eigen::Vector4f> rotation;  // [K] w x y z, world_from_template
  std::vector<Vec3f> translation;         // [K]
  std::vector<float> scale;               // [K] size about the centroid, 0 … 1
};

/// Cells on their way into another take's (morphing, paper section 6.3): M pairs. Pair p is a closed convex polyhedron whose corner i goes from
/// from[i] to to[i], both relative to its middle; what is drawn of it at instant s is x = rotation (scale ((1 − blend) from + blend to)) +
/// translation.
struct CellMorphs {
  std::vector<std::int32_t> source;                    // [M] cell of the take, or −1: it grows from nothing
  std::vector<std::int32_t> target;                    // [M] cell of the other take, or −1: it shrinks to nothing
  std::vector<std::int64_t> vertex_offset;             // [M+1]; empty: there is no morph at all
  std::vector<Vec3> from, to;                          // [v]
  std::vector<std::int64_t> triangle_offset;           // [M+1]
  std::vector<std::array<std::int32_t, 3>> triangles;  // indices within the pair's own corners, counter-clockwise seen from outside
  std::vector<float> blend;                            // [S*M] 0: not drawn (the take's own cell still is, or nothing is left); 1: arrived
  std::vector<float> scale;                            // [S*M] keeps the volume going evenly from one to the other
  std::vector<Eigen::Vector4f> rotation;               // [S*M] w x y z
  std::vector<Vec3f> translation;                      // [S*M] of the middle, in the world
};

/// One effect run on a tracked take: the content of simulated.h5 (docs/storage_format.md). S stored instants, n cells, m objects.
/// Cells keep their template shapes; poses are world_from_template, as in tracked.h5.
struct SimulatedTake {
  std::string effect_json;                     // the effect as it was run, defaults filled in
  std::vector<double> time;                    // [S] seconds from the take's first frame
  std::vector<Eigen::Vector4f> cell_rotation;  // [S*n] w x y z
  std::vector<Vec3> cell_translation;          // [S*n]
  std::vector<CellState> cell_state;           // [S*n]
  std::vector<float> cell_scale;               // [S*n] size about the centroid, 0 … 1; or empty: all cells keep their size
  CellCopies copies;
  CellMorphs morph;
  std::vector<SceneObject> objects;  // [m]
  std::vector<Rigid3> object_pose;   // [S*m] world_from_object

  std::int64_t step_count = 0;  // of the physics, in all; not stored
  /// The deepest that things were ever in each other, metres: what the physics could not hold apart.
  double cell_penetration_m = 0;    // two cells: how much deeper than when they began to collide, or at any time since
  double cell_overlap_m = 0;        // two cells that were in each other already when they began to collide
  double object_penetration_m = 0;  // a cell in an object
  double ground_penetration_m = 0;  // a cell in the ground
};

}  // namespace vorocast::geometry
