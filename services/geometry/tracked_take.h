// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <cstdint>
#include <vector>

#include "services/geometry/cells.h"
#include "services/geometry/rigid3.h"

namespace vorocast::geometry {

/// One frame's cells, chosen to be followed through the take, grouped into patches that move rigidly (paper, section 4.2).
struct Template {
  Cells cells;
  std::int32_t frame = 0;           // the captured frame it was made from
  std::vector<std::int32_t> patch;  // [n] patch of each cell, 0 … patch_count−1
  std::int32_t patch_count = 0;     // P; every patch has at least one cell, all of one component
};

enum class FrameState : std::uint8_t { kTracked = 0, kInterpolated = 1 };

/// Patch poses over a run of frames: what the guide and the windows make, and the patch part of a tracked take.
struct PoseTrack {
  std::vector<std::int32_t> frames;         // [F] ascending frame numbers
  std::int32_t patch_count = 0;             // P
  std::vector<Rigid3> world_from_template;  // [F*P], row-major: frame, then patch
  std::vector<FrameState> state;            // [F]
  std::vector<double> residual;             // [F] root mean square point-to-plane distance of the associated surface points, metres
  std::vector<double> confidence;           // [F] fraction of the surface points that found a compatible partner within 2 σ, 0 … 1
  std::vector<Rigid3> cell_pose;            // [F*n] world_from_template of the template's cells; empty where they go with their patches

  const Rigid3& Pose(std::size_t f, std::size_t p) const { return world_from_template[f * static_cast<std::size_t>(patch_count) + p]; }
  Rigid3& Pose(std::size_t f, std::size_t p) { return world_from_template[f * static_cast<std::size_t>(patch_count) + p]; }
};

/// A take whose template has been followed through every frame: the content of tracked.h5 (docs/storage_format.md).
struct TrackedTake {
  Template model;
  double frames_per_second = 25;
  PoseTrack patches;                           // F frames
  std::vector<Eigen::Vector4f> cell_rotation;  // [F*n] w x y z, unit
  std::vector<Vec3> cell_translation;          // [F*n] world_from_template: x_world = R x_template + t

  std::size_t frame_count() const { return patches.frames.size(); }
  std::size_t cell_count() const { return model.cells.size(); }
  Rigid3 CellPose(std::size_t f, std::size_t c) const {
    const Eigen::Vector4f& q = cell_rotation[f * cell_count() + c];
    return {Quat(q[0], q[1], q[2], q[3]).normalized(), cell_translation[f * cell_count() + c]};
  }
};

}  // namespace vorocast::geometry
