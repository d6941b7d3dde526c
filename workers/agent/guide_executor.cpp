// SPDX-License-Identifier: AGPL-3.0-or-later
#include "workers/agent/guide_executor.h"

#include <algorithm>
#include <iterator>

#include "services/tasks/options.h"
#include "workers/agent/task_inputs.h"

namespace vorocast::agent {
namespace {

/// Share of the time for reading, for the progress.
constexpr double kRead = 0.3;

/// The seams' frames among the inputs.
std::vector<const tasks::Input*> InputsOfFrames(const std::vector<const tasks::Input*>& inputs, const std::vector<std::int32_t>& frames) {
  std::vector<const tasks::Input*> chosen;
  std::ranges::copy_if(inputs, std::back_inserter(chosen),
                       [&](const tasks::Input* input) { return std::ranges::binary_search(frames, input->frame); });
  return chosen;
}

/// A take in stretches is joined at their seams; a short one is followed as a whole.
absl::StatusOr<geometry::PoseTrack> GuideOf(const tasks::TaskSpec& spec, const storage::ArtifactStore& store, const geometry::Template& model,
                                            const tracking::GuideOptions& options, const base::Progress& progress) {
  ASSIGN_OR_RETURN(const std::vector<geometry::Stretch> stretches, ReadStretches(spec, store));
  std::vector<const tasks::Input*> inputs = InputsOf(spec, "cells");
  if (!stretches.empty()) {
    ASSIGN_OR_RETURN(const std::vector<std::int32_t> seams, tracking::SeamFrames(stretches));
    inputs = InputsOfFrames(inputs, seams);
  }
  ASSIGN_OR_RETURN(const std::vector<tracking::Observation> frames, CoarseObservationsOf(inputs, store, options.points, Part(progress, 0, kRead)));
  if (stretches.empty()) return tracking::Guide(model, frames, options, Part(progress, kRead, 1));
  return tracking::JoinStretches(model, stretches, frames, options, Part(progress, kRead, 1));
}

}  // namespace

absl::Status GuideExecutor::Execute(const tasks::TaskSpec& spec, const storage::ArtifactStore& store, const std::filesystem::path& output,
                                    const base::Progress& progress) {
  ASSIGN_OR_RETURN(const auto options, OptionsOf<tasks::GuideOptions>(spec));
  ASSIGN_OR_RETURN(const std::filesystem::path template_path, PathOfOnly(spec, "template", store));
  ASSIGN_OR_RETURN(const geometry::Template model, storage::ReadTemplate(template_path));
  ASSIGN_OR_RETURN(const geometry::PoseTrack track, GuideOf(spec, store, model, {options.points, options.iterations}, progress));
  return storage::WritePoseTrack(output, track, ProvenanceOf(spec, 0));
}

}  // namespace vorocast::agent
