// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <vector>

#include "workers/tracking/cell_blending.h"
#include "workers/tracking/elastic_fit.h"
#include "workers/tracking/patch_model.h"

namespace vorocast::tracking {

/// A template cut into many small nodes of about five cells, so that it can deform within its patches; and the ways between patches, nodes and cells.
class FineModel {
 public:
  /// `model` must be valid and outlive this.
  explicit FineModel(const geometry::Template& model);

  const PatchModel& nodes() const { return nodes_; }

  /// The nodes' maps when the patches are posed so: each the best over its cells, which blend the patches' poses.
  Deformation FromPatches(const geometry::Rigid3* patch_pose) const;
  /// world_from_template of every cell: [n].
  std::vector<geometry::Rigid3> CellPoses(const Deformation& deformation) const;
  /// world_from_template of every patch, best over its cells: [P].
  Pose PatchPoses(const std::vector<geometry::Rigid3>& cell_pose) const;

 private:
  const geometry::Template& model_;
  std::vector<std::int32_t> node_;  // [n] of each cell
  PatchModel nodes_;
  CellBlending patch_blending_;
  CellBlending node_blending_;
  std::vector<geometry::Vec3> surface_arm_;  // [n] from the centroid to the middle of the cell's surface; zero inside
};

}  // namespace vorocast::tracking
