// SPDX-License-Identifier: AGPL-3.0-or-later
#include "workers/agent/track_executor.h"

#include <algorithm>
#include <limits>
#include <utility>

#include <fmt/format.h>
#include "services/tasks/options.h"
#include "workers/agent/task_inputs.h"

namespace vorocast::agent {
namespace {

constexpr std::size_t kAll = std::numeric_limits<std::size_t>::max();

/// The window's frames, each from its input.
absl::StatusOr<std::vector<tracking::Observation>> ReadWindow(const tasks::TaskSpec& spec, const storage::ArtifactStore& store,
                                                              const std::vector<std::int32_t>& frames) {
  const std::vector<const tasks::Input*> inputs = InputsOf(spec, "cells");
  std::vector<tracking::Observation> window;
  for (const std::int32_t frame : frames) {
    const auto input = std::find_if(inputs.begin(), inputs.end(), [frame](const tasks::Input* candidate) { return candidate->frame == frame; });
    if (input == inputs.end()) return absl::InvalidArgumentError(fmt::format("frame {} of the window is not among the inputs", frame));
    ASSIGN_OR_RETURN(tracking::Observation observation, ObservationOf(**input, store, kAll, kAll));
    window.push_back(std::move(observation));
  }
  return window;
}

}  // namespace

absl::Status TrackExecutor::Execute(const tasks::TaskSpec& spec, const storage::ArtifactStore& store, const std::filesystem::path& output,
                                    const base::Progress& progress) {
  ASSIGN_OR_RETURN(const auto options, OptionsOf<tasks::TrackOptions>(spec));
  ASSIGN_OR_RETURN(const std::filesystem::path template_path, PathOfOnly(spec, "template", store));
  ASSIGN_OR_RETURN(const geometry::Template model, storage::ReadTemplate(template_path));
  ASSIGN_OR_RETURN(const std::filesystem::path guide_path, PathOfOnly(spec, "guide", store));
  ASSIGN_OR_RETURN(geometry::PoseTrack start, storage::ReadPoseTrack(guide_path));
  ASSIGN_OR_RETURN(const std::vector<geometry::Stretch> stretches, ReadStretches(spec, store));
  if (!stretches.empty()) {
    ASSIGN_OR_RETURN(start, tracking::CarryAlongStretches(model, start, stretches, options.frames));
  }
  ASSIGN_OR_RETURN(const std::vector<tracking::Observation> window, ReadWindow(spec, store, options.frames));

  const tracking::TrackOptions track_options{.iterations = options.iterations,
                                             .regulariser = options.regulariser,
                                             .sigma_start_m = options.sigma_start_m,
                                             .sigma_end_m = options.sigma_end_m,
                                             .normal_angle_max_deg = options.normal_angle_max_deg,
                                             .depth_tolerance_m = options.depth_tolerance_m};
  ASSIGN_OR_RETURN(const geometry::PoseTrack track, tracking::TrackWindow(model, window, start, track_options, progress));
  return storage::WritePoseTrack(output, track, ProvenanceOf(spec, 0));
}

}  // namespace vorocast::agent
