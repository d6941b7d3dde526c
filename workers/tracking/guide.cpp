// SPDX-License-Identifier: AGPL-3.0-or-later
#include <algorithm>

#include "workers/tracking/follower.h"
#include "workers/tracking/pose_interpolation.h"

namespace vorocast::tracking {
namespace {

using geometry::FrameState;
using geometry::PoseTrack;

/// The pass through all frames, outward from the template's.
class GuidePass {
 public:
  GuidePass(const PatchModel& model, const std::vector<Observation>& frames, const GuideOptions& options, const base::Progress& progress)
      : model_(model), frames_(frames), options_(options), progress_(progress), fit_(model) {
    track_.patch_count = model.patch_count;
    for (const Observation& observation : frames) track_.frames.push_back(observation.frame);
    track_.world_from_template.resize(frames.size() * static_cast<std::size_t>(model.patch_count));
    track_.state.assign(frames.size(), FrameState::kInterpolated);
    track_.residual.assign(frames.size(), 0);
    track_.confidence.assign(frames.size(), 0);
  }

  absl::StatusOr<PoseTrack> Run(std::int32_t template_frame) {
    const Pose identity(static_cast<std::size_t>(model_.patch_count));
    const auto first = std::ranges::lower_bound(track_.frames, template_frame) - track_.frames.begin();
    const bool observed = first < std::ssize(frames_) && frames_[first].frame == template_frame;
    Follower forward(model_, fit_, options_, template_frame - 1, identity);
    if (observed) RETURN_IF_ERROR(Take(forward, first));
    Follower backward = observed ? forward : Follower(model_, fit_, options_, template_frame + 1, identity);
    if (observed && first > 0 && first + 1 < std::ssize(frames_)) RETURN_IF_ERROR(FindSpeed(forward, backward, first));
    for (auto f = first + (observed ? 1 : 0); f < std::ssize(frames_); ++f) RETURN_IF_ERROR(Take(forward, f));
    for (auto f = first - 1; f >= 0; --f) RETURN_IF_ERROR(Take(backward, f));
    RETURN_IF_ERROR(FillUntracked(model_.centre, track_));
    return std::move(track_);
  }

 private:
  /// A template in the midst of its frames may be moving fast, and nothing tells how fast. Followed from rest, the frame before it and the frame
  /// after it are each a guess at its speed, which the other direction may start with; the one that fits better goes first.
  absl::Status FindSpeed(Follower& forward, Follower& backward, std::ptrdiff_t first) {
    ASSIGN_OR_RETURN(const ObservedFrame before, PrepareObservation(frames_[first - 1]));
    ASSIGN_OR_RETURN(const ObservedFrame after, PrepareObservation(frames_[first + 1]));
    if (before.empty() || after.empty()) return absl::OkStatus();
    const std::int32_t before_frame = frames_[first - 1].frame;
    const std::int32_t after_frame = frames_[first + 1].frame;
    Pose ahead = Follower(forward).Follow(after_frame, after);
    Pose behind = Follower(backward).Follow(before_frame, before);
    if (SquaredMean(before, behind) < SquaredMean(after, ahead)) {
      forward.Expect(before_frame, std::move(behind));
      ahead = Follower(forward).Follow(after_frame, after);
      backward.Expect(after_frame, std::move(ahead));
    } else {
      backward.Expect(after_frame, std::move(ahead));
      behind = Follower(backward).Follow(before_frame, before);
      forward.Expect(before_frame, std::move(behind));
    }
    return absl::OkStatus();
  }

  double SquaredMean(const ObservedFrame& observed, const Pose& pose) {
    FitStage stage = GuideStage(options_, options_.iterations - 1, observed.position.size());
    stage.phase = 0;
    return fit_.Measure(observed, stage, pose).squared_mean;
  }

  absl::Status Take(Follower& follower, std::ptrdiff_t f) {
    auto observed = PrepareObservation(frames_[f]);
    if (!observed.ok()) return observed.status();
    base::Report(progress_, static_cast<double>(++done_) / static_cast<double>(frames_.size()));
    if (observed->empty()) return absl::OkStatus();
    const Pose& pose = follower.Follow(frames_[f].frame, *observed);
    std::ranges::copy(pose, track_.world_from_template.begin() + f * model_.patch_count);
    FitStage stage = GuideStage(options_, options_.iterations - 1, observed->position.size());
    stage.phase = 0;
    const FitQuality quality = fit_.Measure(*observed, stage, pose);
    track_.residual[f] = quality.residual_m;
    track_.confidence[f] = quality.confidence;
    track_.state[f] = FrameState::kTracked;
    return absl::OkStatus();
  }

  const PatchModel& model_;
  const std::vector<Observation>& frames_;
  const GuideOptions& options_;
  const base::Progress& progress_;
  FrameFit fit_;
  PoseTrack track_;
  std::size_t done_ = 0;
};

}  // namespace

absl::StatusOr<PoseTrack> Guide(const geometry::Template& model, const std::vector<Observation>& frames, const GuideOptions& options,
                                const base::Progress& progress) {
  RETURN_IF_ERROR(base::Annotate(ValidateTemplate(model), "guide"));
  RETURN_IF_ERROR(base::Annotate(ValidateGuide(frames, options), "guide"));
  const PatchModel patches = BuildPatchModel(model.cells, model.patch, model.patch_count);
  auto track = GuidePass(patches, frames, options, progress).Run(model.frame);
  if (!track.ok()) return base::Annotate(track.status(), "guide");
  return track;
}

}  // namespace vorocast::tracking
