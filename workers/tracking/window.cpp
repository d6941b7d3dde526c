// SPDX-License-Identifier: AGPL-3.0-or-later
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "workers/tracking/frame_fit.h"
#include "workers/tracking/pose_interpolation.h"
#include "workers/tracking/tracking.h"

namespace vorocast::tracking {
namespace {

using geometry::FrameState;
using geometry::PoseTrack;

// Points a frame in all iterations but the last few: association is nearly all of the cost, and a frame has far more points than unknowns.
constexpr std::size_t kPointsEarly = 3000;
constexpr std::size_t kPointsLate = 12000;
constexpr std::size_t kPointsMeasured = 5000;
constexpr int kLateIterations = 2;
constexpr int kFirstMeanSteps = 4;

/// The stage of one iteration: σ falls geometrically; points are drawn by turns, so that over the iterations every point is used.
FitStage StageOf(const TrackOptions& options, std::int32_t iteration, std::size_t points) {
  const bool late = iteration + kLateIterations >= options.iterations;
  const double progress = options.iterations > 1 ? static_cast<double>(iteration) / (options.iterations - 1) : 1.0;
  FitStage stage;
  stage.sigma_m = options.sigma_start_m * std::pow(options.sigma_end_m / options.sigma_start_m, progress);
  stage.coarse = stage.sigma_m > 0.010;
  stage.reach_m = stage.coarse ? std::max(2 * stage.sigma_m, 0.030) : 0.016;
  stage.cosine_min = std::cos(options.normal_angle_max_deg * std::numbers::pi / 180);
  stage.depth_tolerance_m = options.depth_tolerance_m;
  stage.regulariser = options.regulariser;
  stage.stride = std::max<std::size_t>(1, points / (late ? kPointsLate : kPointsEarly));
  stage.phase = static_cast<std::size_t>(iteration) % stage.stride;
  return stage;
}

/// The rows of `start` that belong to the window's frames.
absl::StatusOr<std::vector<Pose>> StartPoses(const std::vector<Observation>& window, const PoseTrack& start, std::int32_t patch_count) {
  if (start.patch_count != patch_count) {
    return absl::InvalidArgumentError(
        fmt::format("the start has {} patches, the template {}; both must come from one template", start.patch_count, patch_count));
  }
  if (start.world_from_template.size() != start.frames.size() * static_cast<std::size_t>(patch_count)) {
    return absl::InvalidArgumentError("the start does not have one pose for each of its frames and patches");
  }
  std::vector<Pose> poses;
  for (const Observation& observation : window) {
    const auto row = std::ranges::find(start.frames, observation.frame) - start.frames.begin();
    if (row == static_cast<std::ptrdiff_t>(start.frames.size())) {
      return absl::InvalidArgumentError(fmt::format("the start holds no pose for frame {} of the window", observation.frame));
    }
    const auto first = start.world_from_template.begin() + row * patch_count;
    poses.emplace_back(first, first + patch_count);
  }
  return poses;
}

absl::Status ValidateWindow(const std::vector<Observation>& window) {
  if (window.empty()) return absl::InvalidArgumentError("the window has no frames");
  for (std::size_t f = 1; f < window.size(); ++f) {
    if (window[f].frame <= window[f - 1].frame) {
      return absl::InvalidArgumentError(fmt::format("frame {} follows frame {}; frames must ascend", window[f].frame, window[f - 1].frame));
    }
  }
  return absl::OkStatus();
}

/// The window's frames that can be fitted, and their poses.
struct Fitted {
  std::vector<std::size_t> frame;  // index into the window
  std::vector<ObservedFrame> observed;
  std::vector<Pose> pose;
};

/// Frames and their mean pose by turns (paper, section 4.5): each frame takes a step towards its data with the mean pose fixed, then the mean
/// follows.
void FitFrames(FrameFit& fit, const PatchModel& model, const TrackOptions& options, Fitted& fitted, const base::Progress& progress) {
  Pose mean = fitted.pose[fitted.pose.size() / 2];
  UpdateMeanPose(model, fitted.pose, kFirstMeanSteps, fit.equations(), mean);
  for (std::int32_t iteration = 0; iteration < options.iterations; ++iteration) {
    const std::vector<Relation> reference = RelationsOf(model, mean);
    for (std::size_t f = 0; f < fitted.pose.size(); ++f) {
      fit.Step(fitted.observed[f], StageOf(options, iteration, fitted.observed[f].position.size()), reference, fitted.pose[f]);
    }
    UpdateMeanPose(model, fitted.pose, 1, fit.equations(), mean);
    base::Report(progress, (iteration + 1.0) / (options.iterations + 1.0));
  }
}

}  // namespace

absl::StatusOr<PoseTrack> TrackWindow(const geometry::Template& model, const std::vector<Observation>& window, const PoseTrack& start,
                                      const TrackOptions& options, const base::Progress& progress) {
  RETURN_IF_ERROR(base::Annotate(options.Validate(), "track window"));
  RETURN_IF_ERROR(base::Annotate(ValidateTemplate(model), "track window"));
  RETURN_IF_ERROR(base::Annotate(ValidateWindow(window), "track window"));
  auto start_poses = StartPoses(window, start, model.patch_count);
  if (!start_poses.ok()) return base::Annotate(start_poses.status(), "track window");

  PoseTrack track;
  track.patch_count = model.patch_count;
  Fitted fitted;
  for (std::size_t f = 0; f < window.size(); ++f) {
    auto observed = PrepareObservation(window[f]);
    if (!observed.ok()) return base::Annotate(observed.status(), "track window");
    track.frames.push_back(window[f].frame);
    track.state.push_back(observed->empty() ? FrameState::kInterpolated : FrameState::kTracked);
    if (observed->empty()) continue;
    fitted.frame.push_back(f);
    fitted.observed.push_back(*std::move(observed));
    fitted.pose.push_back((*start_poses)[f]);
  }
  track.residual.assign(window.size(), 0);
  track.confidence.assign(window.size(), 0);

  if (!fitted.frame.empty()) {
    const PatchModel patches = BuildPatchModel(model.cells, model.patch, model.patch_count);
    FrameFit fit(patches);
    FitFrames(fit, patches, options, fitted, progress);
    for (std::size_t i = 0; i < fitted.frame.size(); ++i) {
      FitStage stage = StageOf(options, options.iterations - 1, fitted.observed[i].position.size());
      stage.stride = std::max<std::size_t>(1, fitted.observed[i].position.size() / kPointsMeasured);
      stage.phase = 0;
      const FitQuality quality = fit.Measure(fitted.observed[i], stage, fitted.pose[i]);
      track.residual[fitted.frame[i]] = quality.residual_m;
      track.confidence[fitted.frame[i]] = quality.confidence;
      (*start_poses)[fitted.frame[i]] = std::move(fitted.pose[i]);
    }
  }
  for (const Pose& pose : *start_poses) track.world_from_template.insert(track.world_from_template.end(), pose.begin(), pose.end());
  // A window without any observed frame keeps the guide's poses; Assemble knows what lies on both sides of it.
  if (!fitted.frame.empty()) RETURN_IF_ERROR(FillUntracked(PatchCentres(model.cells, model.patch, model.patch_count), track));
  base::Report(progress, 1);
  return track;
}

}  // namespace vorocast::tracking
