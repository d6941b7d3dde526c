// SPDX-License-Identifier: AGPL-3.0-or-later
#include "workers/tracking/follower.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "workers/tracking/pose_interpolation.h"

namespace vorocast::tracking {
namespace {

constexpr double kSigmaStartM = 0.030;
constexpr double kSigmaEndM = 0.012;
// Ten times that of windows: patches should go on as they lay in the last frame, and what bends, bends after that.
constexpr double kRegulariser = 3;
constexpr std::size_t kPointsCompared = 1500;
constexpr int kElasticSteps = 8;
constexpr double kElasticSigmaStartM = 0.010;
constexpr double kElasticSigmaEndM = 0.005;

/// Twice as many points as the rigid patches have: it is their small relief that counts.
std::vector<ElasticStage> ElasticStages(const GuideOptions& options, std::size_t points) {
  std::vector<ElasticStage> stages(kElasticSteps);
  for (int i = 0; i < kElasticSteps; ++i) {
    stages[i].sigma_m = kElasticSigmaStartM * std::pow(kElasticSigmaEndM / kElasticSigmaStartM, i / (kElasticSteps - 1.0));
    stages[i].stride = std::max<std::size_t>(1, points / static_cast<std::size_t>(2 * options.points));
    stages[i].phase = static_cast<std::size_t>(i) % stages[i].stride;
  }
  return stages;
}

}  // namespace

FitStage GuideStage(const GuideOptions& options, std::int32_t iteration, std::size_t points) {
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

Follower::Follower(const PatchModel& model, FrameFit& fit, const GuideOptions& options, std::int32_t frame, Pose pose)
    : model_(model),
      fit_(fit),
      elastic_(model),
      options_(options),
      now_frame_(frame),
      now_(std::move(pose)),
      deformation_(DeformationOf(model, now_)) {}

const Pose& Follower::Follow(std::int32_t frame, const ObservedFrame& observed) {
  Pose pose = Start(frame, observed);
  const std::vector<Relation> reference = RelationsOf(model_, now_);
  for (std::int32_t i = 0; i < options_.iterations; ++i) fit_.Step(observed, GuideStage(options_, i, observed.position.size()), reference, pose);
  Deform(observed, pose);
  before_frame_ = now_frame_;
  before_ = std::move(now_);
  now_frame_ = frame;
  now_ = PoseOf(model_, deformation_);
  return now_;
}

/// Moves the last frame's deformation as the patches went, and fits it.
void Follower::Deform(const ObservedFrame& observed, const Pose& found) {
  for (std::int32_t k = 0; k < model_.patch_count; ++k) {
    const geometry::Rigid3 moved = found[k] * now_[k].Inverse();
    deformation_[k].position = moved * deformation_[k].position;
    deformation_[k].gradient = moved.rotation * deformation_[k].gradient;
  }
  elastic_.Run(observed, ElasticStages(options_, observed.position.size()), deformation_);
}

/// The last pose, or the one that goes on as the last two went: whichever explains the points better.
Pose Follower::Start(std::int32_t frame, const ObservedFrame& observed) {
  if (before_.empty()) return now_;
  const double steps = static_cast<double>(frame - now_frame_) / (now_frame_ - before_frame_);
  Pose moved;
  for (std::int32_t k = 0; k < model_.patch_count; ++k) moved.push_back(Extrapolate(model_.centre[k], before_[k], now_[k], steps));
  FitStage stage = GuideStage(options_, 0, observed.position.size());
  stage.stride = std::max<std::size_t>(1, observed.position.size() / kPointsCompared);
  stage.phase = 0;
  const double still = fit_.Measure(observed, stage, now_).squared_mean;
  return fit_.Measure(observed, stage, moved).squared_mean < still ? moved : now_;
}

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

}  // namespace vorocast::tracking
