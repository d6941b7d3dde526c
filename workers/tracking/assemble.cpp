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
        window.world_from_template.size() != count * static_cast<std::size_t>(window.patch_count)) {
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

/// Blends the windows' poses of one frame into row f of the track.
void BlendVotes(const std::vector<Vec3>& centres, const std::vector<PoseTrack>& windows, const std::vector<Vote>& votes, std::size_t f,
                PoseTrack& track) {
  double total = 0;
  for (const Vote& vote : votes) {
    total += vote.weight;
    const double share = vote.weight / total;  // the running mean: after the last vote each has its weight
    const PoseTrack& window = windows[vote.window];
    for (std::size_t p = 0; p < centres.size(); ++p) {
      track.Pose(f, p) = share == 1 ? window.Pose(vote.row, p) : InterpolateAbout(centres[p], track.Pose(f, p), window.Pose(vote.row, p), share);
    }
    track.residual[f] += share * (window.residual[vote.row] - track.residual[f]);
    track.confidence[f] += share * (window.confidence[vote.row] - track.confidence[f]);
  }
  track.state[f] = FrameState::kTracked;
}

/// A quaternion and its negative are one rotation: consecutive frames keep to one side, so that whoever interpolates them takes the short way.
void AlignSigns(PoseTrack& track) {
  for (std::size_t f = 1; f < track.frames.size(); ++f) {
    for (std::size_t p = 0; p < static_cast<std::size_t>(track.patch_count); ++p) {
      geometry::Quat& q = track.Pose(f, p).rotation;
      if (q.dot(track.Pose(f - 1, p).rotation) < 0) q.coeffs() *= -1;
    }
  }
}

void BlendCells(geometry::TrackedTake& take) {
  const CellBlending blending(take.model.cells, take.model.patch, take.model.patch_count);
  const std::size_t n = take.cell_count();
  take.cell_rotation.reserve(take.frame_count() * n);
  take.cell_translation.reserve(take.frame_count() * n);
  for (std::size_t f = 0; f < take.frame_count(); ++f) {
    for (std::size_t c = 0; c < n; ++c) {
      const Rigid3 pose = blending.Blend(c, &take.patches.Pose(f, 0));
      take.cell_rotation.push_back(Eigen::Vector4d(pose.rotation.w(), pose.rotation.x(), pose.rotation.y(), pose.rotation.z()).cast<float>());
      take.cell_translation.push_back(pose.translation);
    }
  }
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

  const std::vector<Vec3> centres = PatchCentres(model.cells, model.patch, model.patch_count);
  const auto votes = VotesByFrame(windows);
  std::vector<std::int32_t> missing;
  for (std::size_t f = 0; f < track.frames.size(); ++f) {
    const auto found = votes.find(track.frames[f]);
    if (found == votes.end()) {
      missing.push_back(track.frames[f]);
    } else {
      BlendVotes(centres, windows, found->second, f, track);
    }
  }
  if (std::ssize(missing) > options.interpolated_max) {
    return absl::InvalidArgumentError(
        fmt::format("assemble: {} of {} frames could not be tracked, more than the {} that may be interpolated: frames {}", missing.size(),
                    track.frames.size(), options.interpolated_max, fmt::join(missing, ", ")));
  }
  RETURN_IF_ERROR(base::Annotate(FillUntracked(centres, track), "assemble"));
  AlignSigns(track);
  BlendCells(take);
  return take;
}

}  // namespace vorocast::tracking
