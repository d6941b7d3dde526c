// SPDX-License-Identifier: AGPL-3.0-or-later
#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "workers/tracking/frame_fit.h"
#include "workers/tracking/pose_interpolation.h"
#include "workers/tracking/tracking.h"

namespace vorocast::tracking {
namespace {

using geometry::FrameState;
using geometry::PoseTrack;

constexpr double kSigmaStartM = 0.030;
constexpr double kSigmaEndM = 0.012;
constexpr double kRegulariser = 0.3;
constexpr double kFromLastFrame = 0.8;
constexpr std::size_t kPointsCompared = 1500;

FitStage StageOf(const GuideOptions& options, std::int32_t iteration, std::size_t points) {
  const double progress = options.iterations > 1 ? static_cast<double>(iteration) / (options.iterations - 1) : 1.0;
  FitStage stage;
  stage.coarse = true;
  stage.sigma_m = kSigmaStartM * std::pow(kSigmaEndM / kSigmaStartM, progress);
  stage.reach_m = 2 * stage.sigma_m;
  stage.cosine_min = 0.5;
  stage.regulariser = kRegulariser;
  stage.stride =
      std::max<std::size_t>(1, points / static_cast<std::size_t>(2 * iteration < options.iterations ? options.points / 3 : options.points));
  stage.phase = static_cast<std::size_t>(iteration) % stage.stride;
  return stage;
}

/// Follows the template from frame to frame in one direction.
class Follower {
 public:
  Follower(const PatchModel& model, FrameFit& fit, const GuideOptions& options, std::int32_t frame, Pose pose)
      : model_(model), fit_(fit), options_(options), now_frame_(frame), now_(std::move(pose)) {}

  const Pose& Follow(std::int32_t frame, const ObservedFrame& observed) {
    Pose pose = Start(frame, observed);
    const std::vector<Relation> reference = Reference();
    for (std::int32_t i = 0; i < options_.iterations; ++i) fit_.Step(observed, StageOf(options_, i, observed.position.size()), reference, pose);
    before_frame_ = now_frame_;
    before_ = std::move(now_);
    now_frame_ = frame;
    now_ = std::move(pose);
    return now_;
  }

 private:
  /// The last pose, or the one that goes on as the last two went: whichever explains the points better.
  Pose Start(std::int32_t frame, const ObservedFrame& observed) {
    if (before_.empty()) return now_;
    const double steps = static_cast<double>(frame - now_frame_) / (now_frame_ - before_frame_);
    Pose moved;
    for (std::int32_t k = 0; k < model_.patch_count; ++k) moved.push_back(Extrapolate(model_.centre[k], before_[k], now_[k], steps));
    FitStage stage = StageOf(options_, 0, observed.position.size());
    stage.stride = std::max<std::size_t>(1, observed.position.size() / kPointsCompared);
    stage.phase = 0;
    const double still = fit_.Measure(observed, stage, now_).squared_mean;
    return fit_.Measure(observed, stage, moved).squared_mean < still ? moved : now_;
  }

  /// Neighbouring patches should lie nearly as in the last frame, drawn a little towards the template, lest errors add up.
  std::vector<Relation> Reference() const {
    std::vector<Relation> reference = RelationsOf(model_, now_);
    for (Relation& relation : reference) {
      relation.matrix = kFromLastFrame * relation.matrix + (1 - kFromLastFrame) * geometry::Mat3::Identity();
      relation.offset *= kFromLastFrame;
    }
    return reference;
  }

  const PatchModel& model_;
  FrameFit& fit_;
  const GuideOptions& options_;
  std::int32_t now_frame_;
  Pose now_;
  std::int32_t before_frame_ = 0;
  Pose before_;
};

absl::Status ValidateGuide(const std::vector<Observation>& frames, const GuideOptions& options) {
  if (options.points < 100) return absl::InvalidArgumentError(fmt::format("{} points a frame; at least 100 are needed", options.points));
  if (options.iterations < 1) return absl::InvalidArgumentError(fmt::format("{} iterations; at least 1 is needed", options.iterations));
  if (frames.empty()) return absl::InvalidArgumentError("there are no frames");
  for (std::size_t f = 1; f < frames.size(); ++f) {
    if (frames[f].frame <= frames[f - 1].frame) {
      return absl::InvalidArgumentError(fmt::format("frame {} follows frame {}; frames must ascend", frames[f].frame, frames[f - 1].frame));
    }
  }
  return absl::OkStatus();
}

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
    Follower forward(model_, fit_, options_, template_frame - 1, identity);
    for (auto f = first; f < std::ssize(frames_); ++f) RETURN_IF_ERROR(Take(forward, f));
    Follower backward(model_, fit_, options_, template_frame + 1, identity);
    for (auto f = first - 1; f >= 0; --f) RETURN_IF_ERROR(Take(backward, f));
    RETURN_IF_ERROR(FillUntracked(model_.centre, track_));
    return std::move(track_);
  }

 private:
  absl::Status Take(Follower& follower, std::ptrdiff_t f) {
    auto observed = PrepareObservation(frames_[f]);
    if (!observed.ok()) return observed.status();
    base::Report(progress_, static_cast<double>(++done_) / static_cast<double>(frames_.size()));
    if (observed->empty()) return absl::OkStatus();
    const Pose& pose = follower.Follow(frames_[f].frame, *observed);
    std::ranges::copy(pose, track_.world_from_template.begin() + f * model_.patch_count);
    FitStage stage = StageOf(options_, options_.iterations - 1, observed->position.size());
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
