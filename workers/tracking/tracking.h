// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <cstdint>
#include <vector>

#include "services/base/progress.h"
#include "services/base/status.h"
#include "services/geometry/stretch.h"
#include "services/geometry/tracked_take.h"

/// Volumetric tracking (paper, section 4; Allain et al. 2015): a template's patches follow incoherent observations through time.
namespace vorocast::tracking {

/// What was seen in one frame (paper, section 4.3): oriented surface points and the frame's own cells as inner points.
struct Observation {
  std::int32_t frame = 0;
  bool missing = false;               // the frame could not be read or tessellated; its poses are interpolated
  geometry::OrientedPoints surface;   // metres
  std::vector<geometry::Vec3> inner;  // cell centroids
  std::vector<double> inner_depth;    // [inner] distance to the surface, metres
};

/// k-medoids over the cell graph (paper, section 4.2): the patch of each cell, numbered without gaps. Patches are connected and never span
/// components. There are `count` of them, or as many as there are connected parts if that is more, or cells if that is fewer. Deterministic in the
/// seed. INVALID_ARGUMENT for no cells or a count below 1.
absl::StatusOr<std::vector<std::int32_t>> ClusterPatches(const geometry::Cells& cells, std::int32_t count, std::uint64_t seed);

struct GuideOptions {
  std::int32_t points = 6000;  // surface points used a frame; fewer in the first iterations
  std::int32_t iterations = 10;
};

/// A cheap pass through all frames, outward from the template's, that gives every window its start. Frames ascend; missing ones are interpolated and
/// marked. INVALID_ARGUMENT when no frame can be followed.
absl::StatusOr<geometry::PoseTrack> Guide(const geometry::Template& model, const std::vector<Observation>& frames, const GuideOptions& options,
                                          const base::Progress& progress);

/// The same pass for a long take, in parts that run side by side (docs/decisions/0006-a-guide-in-stretches.md). First every stretch of the take is
/// followed on its own, outward from one of its frames, `own`. `frames` ascend and hold own.frame.
absl::StatusOr<geometry::Stretch> FollowStretch(const geometry::Template& own, const std::vector<Observation>& frames, const GuideOptions& options,
                                                const base::Progress& progress);

/// One frame for each pair of consecutive stretches, in which both know where they are: where one hands the template over to the next.
/// INVALID_ARGUMENT when two of them share no frame.
absl::StatusOr<std::vector<std::int32_t>> SeamFrames(const std::vector<geometry::Stretch>& stretches);

/// Then the template is carried by the stretches' motions, outward from its own frame, and fitted to what was seen in each seam frame: its poses in
/// those frames and its own. `seams` holds an observation, perhaps a missing one, of each of SeamFrames(). INVALID_ARGUMENT when no stretch holds the
/// template's frame.
absl::StatusOr<geometry::PoseTrack> JoinStretches(const geometry::Template& model, const std::vector<geometry::Stretch>& stretches,
                                                  const std::vector<Observation>& seams, const GuideOptions& options, const base::Progress& progress);

/// What Guide gives for `frames` (ascending), from the poses that JoinStretches left: in between, the stretches carry the template from both sides.
/// `stretches` need only be those that hold a frame of `frames`.
absl::StatusOr<geometry::PoseTrack> CarryAlongStretches(const geometry::Template& model, const geometry::PoseTrack& joined,
                                                        const std::vector<geometry::Stretch>& stretches, const std::vector<std::int32_t>& frames);

struct TrackOptions {
  std::int32_t iterations = 6;
  double regulariser = 0.3;
  double sigma_start_m = 0.010;
  double sigma_end_m = 0.005;
  double normal_angle_max_deg = 45;  // θmax
  double depth_tolerance_m = 0.015;  // ε

  absl::Status Validate() const;
};

/// One window (paper, section 4.5), from the guide's start: in each frame the template deforms in nodes of about five cells, smoothly as seen from
/// the start, and the result has a pose for every cell beside those of the patches. `start` holds every frame of `window`; its other frames have no
/// influence. Frames that are missing or have no points are interpolated and marked.
absl::StatusOr<geometry::PoseTrack> TrackWindow(const geometry::Template& model, const std::vector<Observation>& window,
                                                const geometry::PoseTrack& start, const TrackOptions& options, const base::Progress& progress);

struct AssembleOptions {
  double frames_per_second = 25;
  std::vector<std::int32_t> frames;
  std::int32_t interpolated_max = 10;
};

/// Joins windows (overlaps blended) and interpolates missing frames (marked). Cells of a track that has patches alone blend those near them.
absl::StatusOr<geometry::TrackedTake> Assemble(const geometry::Template& model, const std::vector<geometry::PoseTrack>& windows,
                                               const AssembleOptions& options);

/// Where material points given in the template frame are in each frame of a take: each follows the blended transforms of its cells. [F*points]
std::vector<geometry::Vec3> CarryPoints(const geometry::TrackedTake& take, const std::vector<geometry::Vec3>& template_points);

}  // namespace vorocast::tracking
