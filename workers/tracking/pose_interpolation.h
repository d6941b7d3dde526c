// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <vector>

#include "workers/tracking/patch_model.h"

namespace vorocast::tracking {

/// The pose at fraction t between two, for a body centred at `centre` in the template: its centre moves on a straight line while it turns by slerp.
/// Interpolating the bare translations would swing a body far from the origin through an arc that neither pose knows of.
geometry::Rigid3 InterpolateAbout(const geometry::Vec3& centre, const geometry::Rigid3& from, const geometry::Rigid3& to, double t);

/// The pose after moving on from `now` as it moved from `before` to `now`, `steps` times that motion.
geometry::Rigid3 Extrapolate(const geometry::Vec3& centre, const geometry::Rigid3& before, const geometry::Rigid3& now, double steps);

/// Fills frames of `track` that are not kTracked from the nearest tracked ones on both sides, or from the one side there is: patches about `centres`,
/// and cells, where the track has their poses, about `centroids`. INVALID_ARGUMENT when no frame is tracked.
absl::Status FillUntracked(const std::vector<geometry::Vec3>& centres, const std::vector<geometry::Vec3>& centroids, geometry::PoseTrack& track);
/// The same for a track of patches alone.
absl::Status FillUntracked(const std::vector<geometry::Vec3>& centres, geometry::PoseTrack& track);

}  // namespace vorocast::tracking
