// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <vector>

#include "services/base/status.h"
#include "services/geometry/rigid3.h"
#include "services/geometry/tracked_take.h"

namespace vorocast::simulation {

/// The tracked poses at any time (paper, section 5.2): the centroids' positions linearly between frames, rotations by slerp. Before the
/// first and after the last frame the pose is held. Frames that the take skips are bridged over the time that they would have had.
class TrackedMotion {
 public:
  /// `take` outlives this, and has passed CheckTake.
  explicit TrackedMotion(const geometry::TrackedTake& take);

  const geometry::Template& model() const { return *model_; }
  /// Seconds from the first frame to the last.
  double duration_s() const { return frame_time_.back(); }
  std::size_t cell_count() const { return cell_count_; }
  std::size_t frame_count() const { return frame_time_.size(); }
  /// The poses at one of the take's frames, [n]; as Sample gives them.
  const geometry::Rigid3* AtFrame(std::size_t f) const { return &at_frame_[f * cell_count_]; }

  /// world_from_cell of every cell at `time`, where a cell's frame has its origin at the centroid and the template's axes:
  /// translation is the centroid in the world.
  void Sample(double time, std::vector<geometry::Rigid3>& world_from_cell) const;

 private:
  const geometry::Template* model_;
  std::size_t cell_count_;
  std::vector<double> frame_time_;          // [F]
  std::vector<geometry::Rigid3> at_frame_;  // [F*n]
};

/// INVALID_ARGUMENT where the take's arrays do not fit each other or hold a value that is not finite.
absl::Status CheckTake(const geometry::TrackedTake& take);

}  // namespace vorocast::simulation
