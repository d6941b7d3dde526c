// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <vector>

#include "workers/tracking/elastic_fit.h"
#include "workers/tracking/patch_model.h"

namespace vorocast::tracking {

/// Blends the poses of a cell's own patch and the patches next to it into the cell's own rigid pose, so that cells bend where patches can only break.
/// Only patches that share a face with the cell's patch take part: an arm never blends with the torso it hangs beside.
class CellBlending {
 public:
  CellBlending(const geometry::Cells& cells, const std::vector<std::int32_t>& patch, std::int32_t patch_count);

  /// The cell's pose: its rotation is the weighted mean of the patches' (as unit quaternions), and its centroid lies at the weighted mean of where
  /// the patches carry it.
  geometry::Rigid3 Blend(std::size_t cell, const geometry::Rigid3* patch_pose) const;

  /// The cell's map out of those of the nodes: `centre` holds where the nodes' maps have their centres. Its position is that of the cell's centroid.
  AffineNode Blend(std::size_t cell, const std::vector<geometry::Vec3>& centre, const Deformation& nodes) const;

 private:
  struct Share {
    std::int32_t patch;
    double weight;
  };
  std::vector<geometry::Vec3> centroid_;  // [n]
  std::vector<std::int32_t> offset_;      // [n+1] into shares_
  std::vector<Share> shares_;             // the own patch first; weights of a cell sum to 1
};

}  // namespace vorocast::tracking
