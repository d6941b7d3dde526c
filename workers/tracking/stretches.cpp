// SPDX-License-Identifier: AGPL-3.0-or-later
// The guide in parts: stretches that are followed on their own, and the template that they carry.
//
// k  a patch of the template            q  a patch of a stretch
// p  where a template's cell is         M  world_now_from_world_then of a stretch's patch: how the vicinity of its cells moved
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>

#include "workers/tracking/follower.h"
#include "workers/tracking/pose_interpolation.h"
#include "workers/tracking/tracking.h"

namespace vorocast::tracking {
namespace {

using geometry::FrameState;
using geometry::PoseTrack;
using geometry::Quat;
using geometry::Rigid3;
using geometry::Stretch;
using geometry::Vec3;
using geometry::Vec3f;

/// Cells of the template and of a stretch are looked for this many cell spacings around.
constexpr double kNearSpacings = 2.5;

std::ptrdiff_t RowOf(const PoseTrack& track, std::int32_t frame) {
  const auto found = std::ranges::lower_bound(track.frames, frame);
  return found != track.frames.end() && *found == frame ? found - track.frames.begin() : -1;
}

Pose PoseAt(const PoseTrack& track, std::ptrdiff_t row) {
  const auto first = track.world_from_template.begin() + row * track.patch_count;
  return {first, first + track.patch_count};
}

/// The template's patches and cells, as far as carrying needs them.
struct CarriedTemplate {
  explicit CarriedTemplate(const geometry::Template& model)
      : cells(model.cells), patch(model.patch), centre(PatchCentres(cells, patch, model.patch_count)) {
    double volume = 0;
    for (const double v : cells.volume) volume += v;
    near_m = kNearSpacings * std::cbrt(volume / static_cast<double>(cells.size()));
  }
  const geometry::Cells& cells;
  const std::vector<std::int32_t>& patch;
  std::vector<Vec3> centre;  // [patches]
  double near_m = 0;
};

/// The cells of a stretch in one of its frames, to be asked for the nearest.
class PosedCells {
 public:
  PosedCells(const Stretch& stretch, std::ptrdiff_t row, double near_m) : origin_(stretch.motion.Pose(row, 0) * stretch.centroid[0]) {
    for (std::size_t j = 0; j < stretch.centroid.size(); ++j) {
      const std::int32_t q = stretch.patch[j];
      points_.push_back(
          {.position = (stretch.motion.Pose(row, q) * stretch.centroid[j] - origin_).cast<float>(), .normal = Vec3f::Zero(), .patch = q});
    }
    grid_.Build(points_, static_cast<float>(near_m));
  }

  std::int32_t NearestPatch(const Vec3& position) const {
    const Vec3f x = (position - origin_).cast<float>();
    float nearest = std::numeric_limits<float>::infinity();
    std::int32_t patch = -1;
    const auto offer = [&](const PosedPoint& point) {
      const float distance = (point.position - x).squaredNorm();
      if (distance > nearest || (distance == nearest && point.patch > patch)) return;
      nearest = distance;
      patch = point.patch;
    };
    grid_.VisitNear(x, offer);
    if (patch < 0) std::ranges::for_each(points_, offer);  // strayed far from all of them
    return patch;
  }

 private:
  Vec3 origin_;
  std::vector<PosedPoint> points_;
  PointGrid grid_;
};

/// Carries the template through a stretch from a frame in which its pose is known: each patch moves as the stretch's cells around its own do, in the
/// mean.
class Carrier {
 public:
  Carrier(const CarriedTemplate& model, const Stretch& stretch, std::int32_t frame, Pose pose)
      : model_(model), stretch_(stretch), from_(RowOf(stretch.motion, frame)), pose_(std::move(pose)), shares_(pose_.size()) {
    const PosedCells posed(stretch, from_, model.near_m);
    for (std::size_t c = 0; c < model.cells.size(); ++c) {
      const std::int32_t k = model.patch[c];
      const Vec3 p = pose_[k] * model.cells.centroid[c];
      Share& share = shares_[k][posed.NearestPatch(p)];
      share.sum += p;
      ++share.count;
    }
  }

  Pose To(std::int32_t frame) const {
    const std::ptrdiff_t row = RowOf(stretch_.motion, frame);
    std::vector<Rigid3> moved;  // [q] M
    for (std::int32_t q = 0; q < stretch_.motion.patch_count; ++q)
      moved.push_back(stretch_.motion.Pose(row, q) * stretch_.motion.Pose(from_, q).Inverse());
    Pose pose;
    for (std::size_t k = 0; k < pose_.size(); ++k) pose.push_back(MotionOf(k, moved) * pose_[k]);
    return pose;
  }

 private:
  /// The cells of one patch of the template that go with one patch of the stretch.
  struct Share {
    Vec3 sum = Vec3::Zero();
    std::int32_t count = 0;
  };

  Rigid3 MotionOf(std::size_t k, const std::vector<Rigid3>& moved) const {
    Vec3 before = Vec3::Zero();
    Vec3 after = Vec3::Zero();
    Eigen::Vector4d turn = Eigen::Vector4d::Zero();
    std::int32_t count = 0;
    for (const auto& [q, share] : shares_[k]) {
      before += share.sum;
      after += share.count * (moved[q] * Vec3(share.sum / share.count));
      const Eigen::Vector4d& coefficients = moved[q].rotation.coeffs();
      turn += (turn.dot(coefficients) < 0 ? -share.count : share.count) * coefficients;
      count += share.count;
    }
    const Quat rotation = Quat(turn).normalized();
    return {rotation, after / count - rotation * Vec3(before / count)};
  }

  const CarriedTemplate& model_;
  const Stretch& stretch_;
  std::ptrdiff_t from_;
  Pose pose_;
  std::vector<std::map<std::int32_t, Share>> shares_;  // [k] by q
};

absl::Status ValidateStretches(const std::vector<Stretch>& stretches) {
  if (stretches.empty()) return absl::InvalidArgumentError("there are no stretches");
  for (const Stretch& stretch : stretches) {
    const PoseTrack& motion = stretch.motion;
    const std::size_t poses = motion.frames.size() * static_cast<std::size_t>(std::max(motion.patch_count, 0));
    if (poses == 0 || motion.world_from_template.size() != poses || motion.state.size() != motion.frames.size()) {
      return absl::InvalidArgumentError("a stretch's arrays do not have an entry for each of its frames and patches");
    }
    const auto bad = [&](std::int32_t q) { return q < 0 || q >= motion.patch_count; };
    if (stretch.centroid.empty() || stretch.patch.size() != stretch.centroid.size() || std::ranges::any_of(stretch.patch, bad)) {
      return absl::InvalidArgumentError(fmt::format("the stretch at frame {} does not have a patch for each of its cells", motion.frames[0]));
    }
  }
  return absl::OkStatus();
}

/// The middle one of the shared frames that both could follow; of all shared frames where there is none.
absl::StatusOr<std::int32_t> SeamBetween(const Stretch& a, const Stretch& b) {
  std::vector<std::int32_t> shared;
  std::vector<std::int32_t> followed;
  for (std::size_t row = 0; row < a.motion.frames.size(); ++row) {
    const std::ptrdiff_t other = RowOf(b.motion, a.motion.frames[row]);
    if (other < 0) continue;
    shared.push_back(a.motion.frames[row]);
    if (a.motion.state[row] == FrameState::kTracked && b.motion.state[other] == FrameState::kTracked) followed.push_back(shared.back());
  }
  if (shared.empty()) {
    return absl::InvalidArgumentError(
        fmt::format("the stretch that ends with frame {} and the one from frame {} share no frame", a.motion.frames.back(), b.motion.frames[0]));
  }
  const auto& choice = followed.empty() ? shared : followed;
  return choice[choice.size() / 2];
}

/// The pass from seam to seam, outward from the template's frame.
class SeamPass {
 public:
  SeamPass(const geometry::Template& model, const std::vector<Stretch>& stretches, const std::vector<Observation>& seams, const GuideOptions& options,
           const base::Progress& progress)
      : model_(model),
        carried_(model),
        patches_(BuildPatchModel(model.cells, model.patch, model.patch_count)),
        fit_(patches_),
        stretches_(stretches),
        seams_(seams),
        options_(options),
        progress_(progress) {}

  absl::StatusOr<PoseTrack> Run(const std::vector<std::int32_t>& seam_frames) {
    const auto home = std::ranges::find_if(stretches_, [&](const Stretch& s) { return RowOf(s.motion, model_.frame) >= 0; }) - stretches_.begin();
    if (home == std::ssize(stretches_)) {
      return absl::InvalidArgumentError(fmt::format("no stretch holds the template's frame {}", model_.frame));
    }
    poses_[model_.frame] = Pose(static_cast<std::size_t>(model_.patch_count));
    std::int32_t from = model_.frame;
    for (auto s = home; s + 1 < std::ssize(stretches_); from = seam_frames[s++]) RETURN_IF_ERROR(Take(stretches_[s], from, seam_frames[s]));
    from = model_.frame;
    for (auto s = home; s > 0; from = seam_frames[--s]) RETURN_IF_ERROR(Take(stretches_[s], from, seam_frames[s - 1]));
    return Track();
  }

 private:
  /// Carries the template to a seam and fits it to what was seen there.
  absl::Status Take(const Stretch& stretch, std::int32_t from, std::int32_t to) {
    base::Report(progress_, static_cast<double>(poses_.size()) / static_cast<double>(stretches_.size()));
    if (poses_.contains(to)) return absl::OkStatus();
    Pose pose = Carrier(carried_, stretch, from, poses_.at(from)).To(to);
    const auto seen = std::ranges::find(seams_, to, &Observation::frame);
    if (seen == seams_.end()) return absl::InvalidArgumentError(fmt::format("there is no observation of the seam's frame {}", to));
    auto observed = PrepareObservation(*seen);
    if (!observed.ok()) return observed.status();
    if (!observed->empty()) pose = Follower(patches_, fit_, options_, to, std::move(pose)).Follow(to, *observed);
    poses_[to] = std::move(pose);
    return absl::OkStatus();
  }

  PoseTrack Track() const {
    PoseTrack track;
    track.patch_count = model_.patch_count;
    for (const auto& [frame, pose] : poses_) {
      track.frames.push_back(frame);
      track.world_from_template.insert(track.world_from_template.end(), pose.begin(), pose.end());
    }
    track.state.assign(track.frames.size(), FrameState::kTracked);
    track.residual.assign(track.frames.size(), 0);
    track.confidence.assign(track.frames.size(), 0);
    return track;
  }

  const geometry::Template& model_;
  CarriedTemplate carried_;
  PatchModel patches_;
  FrameFit fit_;
  const std::vector<Stretch>& stretches_;
  const std::vector<Observation>& seams_;
  const GuideOptions& options_;
  const base::Progress& progress_;
  std::map<std::int32_t, Pose> poses_;  // by frame
};

/// Poses of a template between known ones.
class Between {
 public:
  Between(const geometry::Template& model, const PoseTrack& joined, const std::vector<Stretch>& stretches)
      : carried_(model), joined_(joined), stretches_(stretches) {}

  absl::StatusOr<Pose> At(std::int32_t frame) {
    const auto after = std::ranges::lower_bound(joined_.frames, frame) - joined_.frames.begin();
    const auto count = std::ssize(joined_.frames);
    if (after < count && joined_.frames[after] == frame) return PoseAt(joined_, after);
    if (after == 0) return From(after, frame, after);
    if (after == count) return From(after - 1, frame, after - 1);
    ASSIGN_OR_RETURN(const Pose left, From(after - 1, frame, after));
    ASSIGN_OR_RETURN(const Pose right, From(after, frame, after - 1));
    const double t = static_cast<double>(frame - joined_.frames[after - 1]) / (joined_.frames[after] - joined_.frames[after - 1]);
    Pose pose;
    for (std::size_t k = 0; k < left.size(); ++k) pose.push_back(InterpolateAbout(carried_.centre[k], left[k], right[k], t));
    return pose;
  }

 private:
  /// From row `from` of the known poses to `frame`, by the stretch that holds both and row `other` too.
  absl::StatusOr<Pose> From(std::ptrdiff_t from, std::int32_t frame, std::ptrdiff_t other) {
    const std::int32_t from_frame = joined_.frames[from];
    for (std::size_t s = 0; s < stretches_.size(); ++s) {
      const PoseTrack& motion = stretches_[s].motion;
      if (RowOf(motion, from_frame) < 0 || RowOf(motion, frame) < 0 || RowOf(motion, joined_.frames[other]) < 0) continue;
      auto carrier = carriers_.find({s, from});
      if (carrier == carriers_.end()) {
        carrier = carriers_.emplace(std::pair(s, from), Carrier(carried_, stretches_[s], from_frame, PoseAt(joined_, from))).first;
      }
      return carrier->second.To(frame);
    }
    return absl::InvalidArgumentError(fmt::format("no stretch leads from frame {} to frame {}", from_frame, frame));
  }

  CarriedTemplate carried_;
  const PoseTrack& joined_;
  const std::vector<Stretch>& stretches_;
  std::map<std::pair<std::size_t, std::ptrdiff_t>, Carrier> carriers_;  // by stretch and row of the known pose
};

}  // namespace

absl::StatusOr<Stretch> FollowStretch(const geometry::Template& own, const std::vector<Observation>& frames, const GuideOptions& options,
                                      const base::Progress& progress) {
  auto motion = Guide(own, frames, options, progress);
  if (!motion.ok()) return motion.status();
  return Stretch{.frame = own.frame, .centroid = own.cells.centroid, .patch = own.patch, .motion = *std::move(motion)};
}

absl::StatusOr<std::vector<std::int32_t>> SeamFrames(const std::vector<Stretch>& stretches) {
  RETURN_IF_ERROR(base::Annotate(ValidateStretches(stretches), "seams"));
  std::vector<std::int32_t> frames;
  for (std::size_t s = 1; s < stretches.size(); ++s) {
    const auto frame = SeamBetween(stretches[s - 1], stretches[s]);
    if (!frame.ok()) return base::Annotate(frame.status(), "seams");
    frames.push_back(*frame);
  }
  return frames;
}

absl::StatusOr<PoseTrack> JoinStretches(const geometry::Template& model, const std::vector<Stretch>& stretches, const std::vector<Observation>& seams,
                                        const GuideOptions& options, const base::Progress& progress) {
  RETURN_IF_ERROR(base::Annotate(ValidateTemplate(model), "guide"));
  ASSIGN_OR_RETURN(const std::vector<std::int32_t> seam_frames, SeamFrames(stretches));
  auto track = SeamPass(model, stretches, seams, options, progress).Run(seam_frames);
  if (!track.ok()) return base::Annotate(track.status(), "guide");
  return track;
}

absl::StatusOr<PoseTrack> CarryAlongStretches(const geometry::Template& model, const PoseTrack& joined, const std::vector<Stretch>& stretches,
                                              const std::vector<std::int32_t>& frames) {
  RETURN_IF_ERROR(base::Annotate(ValidateTemplate(model), "guide"));
  RETURN_IF_ERROR(base::Annotate(ValidateStretches(stretches), "guide"));
  if (joined.patch_count != model.patch_count || joined.frames.empty() ||
      joined.world_from_template.size() != joined.frames.size() * static_cast<std::size_t>(joined.patch_count)) {
    return absl::InvalidArgumentError(fmt::format("guide: {} poses of {} patches do not belong to a template of {} patches", joined.frames.size(),
                                                  joined.patch_count, model.patch_count));
  }
  Between between(model, joined, stretches);
  PoseTrack track;
  track.patch_count = model.patch_count;
  for (const std::int32_t frame : frames) {
    const auto pose = between.At(frame);
    if (!pose.ok()) return base::Annotate(pose.status(), "guide");
    track.frames.push_back(frame);
    track.world_from_template.insert(track.world_from_template.end(), pose->begin(), pose->end());
  }
  track.state.assign(track.frames.size(), FrameState::kTracked);
  track.residual.assign(track.frames.size(), 0);
  track.confidence.assign(track.frames.size(), 0);
  return track;
}

}  // namespace vorocast::tracking
