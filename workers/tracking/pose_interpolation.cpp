// SPDX-License-Identifier: AGPL-3.0-or-later
#include "workers/tracking/pose_interpolation.h"

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

absl::Status FillUntracked(const std::vector<Vec3>& centres, geometry::PoseTrack& track) {
  const auto count = static_cast<std::ptrdiff_t>(track.frames.size());
  std::ptrdiff_t before = -1;
  for (std::ptrdiff_t f = 0; f < count; ++f) {
    if (track.state[f] == FrameState::kTracked) {
      before = f;
      continue;
    }
    std::ptrdiff_t after = f + 1;
    while (after < count && track.state[after] != FrameState::kTracked) ++after;
    if (before < 0 && after == count) return absl::InvalidArgumentError("no frame of the take could be tracked, so none can be interpolated");
    for (std::size_t p = 0; p < centres.size(); ++p) {
      if (before < 0) {
        track.Pose(f, p) = track.Pose(after, p);
      } else if (after == count) {
        track.Pose(f, p) = track.Pose(before, p);
      } else {
        const double t = static_cast<double>(track.frames[f] - track.frames[before]) / (track.frames[after] - track.frames[before]);
        track.Pose(f, p) = InterpolateAbout(centres[p], track.Pose(before, p), track.Pose(after, p), t);
      }
    }
  }
  return absl::OkStatus();
}

}  // namespace vorocast::tracking
