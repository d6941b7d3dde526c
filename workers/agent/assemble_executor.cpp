// SPDX-License-Identifier: AGPL-3.0-or-later
#include "workers/agent/assemble_executor.h"

#include <utility>

#include <fmt/format.h>
#include "services/tasks/options.h"
#include "workers/agent/task_inputs.h"

namespace vorocast::agent {

absl::Status AssembleExecutor::Execute(const tasks::TaskSpec& spec, const storage::ArtifactStore& store, const std::filesystem::path& output,
                                       const base::Progress& progress) {
  ASSIGN_OR_RETURN(const auto options, OptionsOf<tasks::AssembleOptions>(spec));
  ASSIGN_OR_RETURN(const std::filesystem::path template_path, PathOfOnly(spec, "template", store));
  ASSIGN_OR_RETURN(const geometry::Template model, storage::ReadTemplate(template_path));
  std::vector<geometry::PoseTrack> windows;
  for (const tasks::Input* input : InputsOf(spec, "window")) {
    if (!input->digest) return absl::InvalidArgumentError(fmt::format("window {} is missing; a take is assembled from all of them", windows.size()));
    ASSIGN_OR_RETURN(geometry::PoseTrack window, storage::ReadPoseTrack(PathOf(*input, store)));
    windows.push_back(std::move(window));
  }
  base::Report(progress, 0.3);
  ASSIGN_OR_RETURN(const geometry::TrackedTake take,
                   tracking::Assemble(model, windows, {options.frames_per_second, options.frames, options.interpolated_max}));
  base::Report(progress, 0.8);
  return storage::WriteTrackedTake(output, take, ProvenanceOf(spec, 0));
}

}  // namespace vorocast::agent
