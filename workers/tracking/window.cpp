// SPDX-License-Identifier: AGPL-3.0-or-later
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "workers/tracking/fine_model.h"
#include "workers/tracking/pose_interpolation.h"
#include "workers/tracking/tracking.h"

namespace vorocast::tracking {
namespace {

using geometry::FrameState;
using geometry::PoseTrack;

// Points a frame and iteration: association is most of the cost. They are drawn by turns, so that over the iterations every point is used.
constexpr std::size_t kPoints = 25000;
constexpr std::size_t kPointsMeasured = 5000;

/// The stage of one iteration: σ falls geometrically.
ElasticStage StageOf(const TrackOptions& options, std::int32_t iteration, std::size_t points) {
  const double progress = options.iterations > 1 ? static_cast<double>(iteration) / (options.iterations - 1) : 1.0;
  ElasticStage stage;
  stage.sigma_m = options.sigma_start_m * std::pow(options.sigma_end_m / options.sigma_start_m, progress);
  stage.reach_m = std::max(stage.reach_m, 2 * stage.sigma_m);
  stage.cosine_min = std::cos(options.normal_angle_max_deg * std::numbers::pi / 180);
  stage.depth_tolerance_m = options.depth_tolerance_m;
  stage.regulariser = options.regulariser;
  stage.stride = std::max<std::size_t>(1, points / kPoints);
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

/// Fits one frame from its start, into row f of the track.
void FitFrame(const FineModel& model, ElasticFit& fit, const TrackOptions& options, const ObservedFrame& observed, std::size_t f, PoseTrack& track) {
  const std::size_t points = observed.position.size();
  std::vector<ElasticStage> stages;
  for (std::int32_t i = 0; i < options.iterations; ++i) stages.push_back(StageOf(options, i, points));
  Deformation deformation = model.FromPatches(&track.Pose(f, 0));
  fit.Run(observed, stages, deformation);

  ElasticStage measured = stages.back();
  measured.stride = std::max<std::size_t>(1, points / kPointsMeasured);
  measured.phase = 0;
  const FitQuality quality = fit.Measure(observed, measured, deformation);
  track.residual[f] = quality.residual_m;
  track.confidence[f] = quality.confidence;
  const std::vector<geometry::Rigid3> cells = model.CellPoses(deformation);
  std::ranges::copy(cells, track.cell_pose.begin() + static_cast<std::ptrdiff_t>(f * cells.size()));
  std::ranges::copy(model.PatchPoses(cells), &track.Pose(f, 0));
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
  for (const Observation& observation : window) track.frames.push_back(observation.frame);
  for (const Pose& pose : *start_poses) track.world_from_template.insert(track.world_from_template.end(), pose.begin(), pose.end());
  track.state.assign(window.size(), FrameState::kInterpolated);
  track.residual.assign(window.size(), 0);
  track.confidence.assign(window.size(), 0);
  track.cell_pose.resize(window.size() * model.cells.size());
  const FineModel fine(model);
  ElasticFit fit(fine.nodes());
  for (std::size_t f = 0; f < window.size(); ++f) {
    auto observed = PrepareObservation(window[f]);
    if (!observed.ok()) return base::Annotate(observed.status(), "track window");
    if (!observed->empty()) {
      FitFrame(fine, fit, options, *observed, f, track);
      track.state[f] = FrameState::kTracked;
    }
    base::Report(progress, (static_cast<double>(f) + 1) / (static_cast<double>(window.size()) + 1));
  }
  // A window without any observed frame keeps the guide's poses; Assemble knows what lies on both sides of it.
  const bool any = std::ranges::count(track.state, FrameState::kTracked) > 0;
  if (any) RETURN_IF_ERROR(FillUntracked(PatchCentres(model.cells, model.patch, model.patch_count), model.cells.centroid, track));
  if (!any) track.cell_pose.clear();
  base::Report(progress, 1);
  return track;
}

}  // namespace vorocast::tracking
