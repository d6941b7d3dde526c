// SPDX-License-Identifier: AGPL-3.0-or-later
#include "workers/agent/guide_executor.h"

#include <algorithm>
#include <utility>

#include "services/tasks/options.h"
#include "workers/agent/task_inputs.h"

namespace vorocast::agent {
namespace {

/// All frames are in memory at once: together they may hold this many points, half a gigabyte, however long the take.
constexpr std::size_t kSurfacePointsMax = 12'000'000;
constexpr std::size_t kInnerPointsMax = 4'000'000;
constexpr std::size_t kInnerPointsEnough = 1000;
/// Share of the time for reading, for the progress.
constexpr double kRead = 0.3;

}  // namespace

absl::Status GuideExecutor::Execute(const tasks::TaskSpec& spec, const storage::ArtifactStore& store, const std::filesystem::path& output,
                                    const base::Progress& progress) {
  ASSIGN_OR_RETURN(const auto options, OptionsOf<tasks::GuideOptions>(spec));
  ASSIGN_OR_RETURN(const std::filesystem::path template_path, PathOfOnly(spec, "template", store));
  ASSIGN_OR_RETURN(const geometry::Template model, storage::ReadTemplate(template_path));

  const std::vector<const tasks::Input*> inputs = InputsOf(spec, "cells");
  const std::size_t count = std::max<std::size_t>(inputs.size(), 1);
  const std::size_t surface_max = std::max(static_cast<std::size_t>(options.points), kSurfacePointsMax / count);
  const std::size_t inner_max = std::max(kInnerPointsEnough, kInnerPointsMax / count);
  std::vector<tracking::Observation> frames;
  for (const tasks::Input* input : inputs) {
    ASSIGN_OR_RETURN(tracking::Observation observation, ObservationOf(*input, store, surface_max, inner_max));
    frames.push_back(std::move(observation));
    base::Report(progress, kRead * static_cast<double>(frames.size()) / static_cast<double>(count));
  }
  ASSIGN_OR_RETURN(const geometry::PoseTrack track, tracking::Guide(model, frames, {options.points, options.iterations}, Part(progress, kRead, 1)));
  return storage::WritePoseTrack(output, track, ProvenanceOf(spec, 0));
}

}  // namespace vorocast::agent
