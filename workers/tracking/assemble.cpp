// SPDX-License-Identifier: AGPL-3.0-or-later
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <map>

#include "workers/tracking/cell_blending.h"
#include "workers/tracking/pose_interpolation.h"
#include "workers/tracking/tracking.h"

namespace vorocast::tracking {
namespace {

using geometry::FrameState;
using geometry::PoseTrack;
using geometry::Rigid3;
using geometry::Vec3;

absl::Status ValidateWindows(const geometry::Template& model, const std::vector<PoseTrack>& windows) {
  for (const PoseTrack& window : windows) {
    const std::size_t count = window.frames.size();
    if (window.patch_count != model.patch_count) {
      return absl::InvalidArgumentError(fmt::format("a window has {} patches, the template {}", window.patch_count, model.patch_count));
    }
    if (count == 0 || window.state.size() != count || window.residual.size() != count || window.confidence.size() != count ||
        window.world_from_template.size() != count * static_cast<std::size_t>(window.patch_count) ||
        (!window.cell_pose.empty() && window.cell_pose.size() != count * model.cells.size())) {
      return absl::InvalidArgumentError("a window's arrays do not all have one entry for each of its frames");
    }
    if (!std::ranges::is_sorted(window.frames))
      return absl::InvalidArgumentError(fmt::format("the frames of the window at {} do not ascend", window.frames[0]));
  }
  return absl::OkStatus();
}

/// A window's say about one of its frames.
struct Vote {
  std::size_t window;
  std::size_t row;
  double weight;  // rises from the window's first frame and falls to its last, so that overlaps fade from one window into the next
};

std::map<std::int32_t, std::vector<Vote>> VotesByFrame(const std::vector<PoseTrack>& windows) {
  std::map<std::int32_t, std::vector<Vote>> votes;
  for (std::size_t w = 0; w < windows.size(); ++w) {
    const std::size_t count = windows[w].frames.size();
    for (std::size_t row = 0; row < count; ++row) {
      if (windows[w].state[row] != FrameState::kTracked) continue;
      votes[windows[w].frames[row]].push_back({w, row, static_cast<double>(std::min(row + 1, count - row))});
    }
  }
  return votes;
}

/// Blends the windows' poses of one frame into row f of the track: of patches and of cells.
void BlendVotes(const std::vector<Vec3>& centres, const CellBlending& blending, const std::vector<Vec3>& centroids,
                const std::vector<PoseTrack>& windows, const std::vector<Vote>& votes, std::size_t f, PoseTrack& track) {
  const auto blend = [](const Vec3& centre, Rigid3& into, const Rigid3& pose, double share) {
    into = share == 1 ? pose : InterpolateAbout(centre, into, pose, share);
  };
  const std::size_t n = centroids.size();
  double total = 0;
  for (const Vote& vote : votes) {
    total += vote.weight;
    const double share = vote.weight / total;  // the running mean: after the last vote each has its weight
    const PoseTrack& window = windows[vote.window];
    for (std::size_t p = 0; p < centres.size(); ++p) blend(centres[p], track.Pose(f, p), window.Pose(vote.row, p), share);
    for (std::size_t c = 0; c < n; ++c) {
      // A window of patches alone, such as the guide's: its cells go with them.
      const Rigid3 pose = window.cell_pose.empty() ? blending.Blend(c, &window.Pose(vote.row, 0)) : window.cell_pose[vote.row * n + c];
      blend(centroids[c], track.cell_pose[f * n + c], pose, share);
    }
    track.residual[f] += share * (window.residual[vote.row] - track.residual[f]);
    track.confidence[f] += share * (window.confidence[vote.row] - track.confidence[f]);
  }
  track.state[f] = FrameState::kTracked;
}

/// A quaternion and its negative are one rotation: consecutive frames keep to one side, so that whoever interpolates them takes the short way.
void AlignSigns(std::size_t frames, std::vector<Rigid3>& poses) {
  const std::size_t row = poses.size() / frames;
  for (std::size_t i = row; i < poses.size(); ++i) {
    geometry::Quat& q = poses[i].rotation;
    if (q.dot(poses[i - row].rotation) < 0) q.coeffs() *= -1;
  }
}

/// Moves the cells' poses from the track to where the take keeps them.
void StoreCells(geometry::TrackedTake& take) {
  take.cell_rotation.reserve(take.patches.cell_pose.size());
  take.cell_translation.reserve(take.patches.cell_pose.size());
  for (const Rigid3& pose : take.patches.cell_pose) {
    take.cell_rotation.push_back(Eigen::Vector4d(pose.rotation.w(), pose.rotation.x(), pose.rotation.y(), pose.rotation.z()).cast<float>());
    take.cell_translation.push_back(pose.translation);
  }
  take.patches.cell_pose = {};
}

}  // namespace

absl::StatusOr<geometry::TrackedTake> Assemble(const geometry::Template& model, const std::vector<PoseTrack>& windows,
                                               const AssembleOptions& options) {
  RETURN_IF_ERROR(base::Annotate(ValidateTemplate(model), "assemble"));
  RETURN_IF_ERROR(base::Annotate(ValidateWindows(model, windows), "assemble"));
  if (!(options.frames_per_second > 0)) {
    return absl::InvalidArgumentError(fmt::format("assemble: {} frames per second; it must be more than 0", options.frames_per_second));
  }
  geometry::TrackedTake take;
  take.model = model;
  take.frames_per_second = options.frames_per_second;
  PoseTrack& track = take.patches;
  track.frames = options.frames;
  std::ranges::sort(track.frames);
  track.frames.erase(std::ranges::unique(track.frames).begin(), track.frames.end());
  if (track.frames.empty()) return absl::InvalidArgumentError("assemble: the take has no frames");
  track.patch_count = model.patch_count;
  track.world_from_template.resize(track.frames.size() * static_cast<std::size_t>(model.patch_count));
  track.state.assign(track.frames.size(), FrameState::kInterpolated);
  track.residual.assign(track.frames.size(), 0);
  track.confidence.assign(track.frames.size(), 0);
  track.cell_pose.resize(track.frames.size() * model.cells.size());

  const CellBlending blending(model.cells, model.patch, model.patch_count);
  const std::vector<Vec3> centres = PatchCentres(model.cells, model.patch, model.patch_count);
  const auto votes = VotesByFrame(windows);
  std::vector<std::int32_t> missing;
  for (std::size_t f = 0; f < track.frames.size(); ++f) {
    const auto found = votes.find(track.frames[f]);
    if (found == votes.end()) {
      missing.push_back(track.frames[f]);
    } else {
      BlendVotes(centres, blending, model.cells.centroid, windows, found->second, f, track);
    }
  }
  if (std::ssize(missing) > options.interpolated_max) {
    return absl::InvalidArgumentError(
        fmt::format("assemble: {} of {} frames could not be tracked, more than the {} that may be interpolated: frames {}", missing.size(),
                    track.frames.size(), options.interpolated_max, fmt::join(missing, ", ")));
  }
  RETURN_IF_ERROR(base::Annotate(FillUntracked(centres, model.cells.centroid, track), "assemble"));
  AlignSigns(track.frames.size(), track.world_from_template);
  AlignSigns(track.frames.size(), track.cell_pose);
  StoreCells(take);
  return take;
}

}  // namespace vorocast::tracking
