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
constexpr double kRegulariser = 0.3;
constexpr double kFromLastFrame = 0.8;
constexpr std::size_t kPointsCompared = 1500;

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
    : model_(model), fit_(fit), options_(options), now_frame_(frame), now_(std::move(pose)) {}

const Pose& Follower::Follow(std::int32_t frame, const ObservedFrame& observed) {
  Pose pose = Start(frame, observed);
  const std::vector<Relation> reference = Reference();
  for (std::int32_t i = 0; i < options_.iterations; ++i) fit_.Step(observed, GuideStage(options_, i, observed.position.size()), reference, pose);
  before_frame_ = now_frame_;
  before_ = std::move(now_);
  now_frame_ = frame;
  now_ = std::move(pose);
  return now_;
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

/// Neighbouring patches should lie nearly as in the last frame, drawn a little towards the template, lest errors add up.
std::vector<Relation> Follower::Reference() const {
  std::vector<Relation> reference = RelationsOf(model_, now_);
  for (Relation& relation : reference) {
    relation.matrix = kFromLastFrame * relation.matrix + (1 - kFromLastFrame) * geometry::Mat3::Identity();
    relation.offset *= kFromLastFrame;
  }
  return reference;
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
