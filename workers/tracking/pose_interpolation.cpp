// SPDX-License-Identifier: AGPL-3.0-or-later
#include "workers/tracking/pose_interpolation.h"

#include <algorithm>

namespace vorocast::tracking {

using geometry::FrameState;
using geometry::Quat;
using geometry::Rigid3;
using geometry::Vec3;

Rigid3 InterpolateAbout(const Vec3& centre, const Rigid3& from, const Rigid3& to, double t) {
  const Quat rotation = from.rotation.slerp(t, to.rotation).normalized();
  const Vec3 posed_centre = (1 - t) * (from * centre) + t * (to * centre);
  return {rotation, posed_centre - rotation * centre};
}

Rigid3 Extrapolate(const Vec3& centre, const Rigid3& before, const Rigid3& now, double steps) {
  Eigen::AngleAxisd turn((now.rotation * before.rotation.conjugate()).normalized());
  if (turn.angle() > EIGEN_PI) turn.angle() -= 2 * EIGEN_PI;
  turn.angle() *= steps;
  const Quat rotation = (Quat(turn) * now.rotation).normalized();
  const Vec3 posed_centre = now * centre + steps * (now * centre - before * centre);
  return {rotation, posed_centre - rotation * centre};
}

namespace {

/// Rows of poses, one row a frame, about the centres of what is posed.
struct PosedRows {
  const std::vector<Vec3>& centres;
  Rigid3* poses;

  Rigid3* Row(std::ptrdiff_t f) const { return poses + f * std::ssize(centres); }
};

/// Row f out of the tracked rows before and after it, of which one may be missing (−1).
void FillRow(const PosedRows& rows, std::ptrdiff_t f, std::ptrdiff_t before, std::ptrdiff_t after, double t) {
  for (std::size_t p = 0; p < rows.centres.size(); ++p) {
    if (before < 0 || after < 0) {
      rows.Row(f)[p] = rows.Row(std::max(before, after))[p];
    } else {
      rows.Row(f)[p] = InterpolateAbout(rows.centres[p], rows.Row(before)[p], rows.Row(after)[p], t);
    }
  }
}

}  // namespace

absl::Status FillUntracked(const std::vector<Vec3>& centres, const std::vector<Vec3>& centroids, geometry::PoseTrack& track) {
  const auto count = static_cast<std::ptrdiff_t>(track.frames.size());
  const PosedRows patches{centres, track.world_from_template.data()};
  const PosedRows cells{centroids, track.cell_pose.data()};
  std::ptrdiff_t before = -1;
  for (std::ptrdiff_t f = 0; f < count; ++f) {
    if (track.state[f] == FrameState::kTracked) {
      before = f;
      continue;
    }
    std::ptrdiff_t after = f + 1;
    while (after < count && track.state[after] != FrameState::kTracked) ++after;
    if (after == count) after = -1;
    if (before < 0 && after < 0) return absl::InvalidArgumentError("no frame of the take could be tracked, so none can be interpolated");
    const double t =
        before >= 0 && after >= 0 ? static_cast<double>(track.frames[f] - track.frames[before]) / (track.frames[after] - track.frames[before]) : 0;
    FillRow(patches, f, before, after, t);
    if (!track.cell_pose.empty()) FillRow(cells, f, before, after, t);
  }
  return absl::OkStatus();
}

absl::Status FillUntracked(const std::vector<Vec3>& centres, geometry::PoseTrack& track) { return FillUntracked(centres, {}, track); }

}  // namespace vorocast::tracking
