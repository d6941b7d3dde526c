// SPDX-License-Identifier: AGPL-3.0-or-later
#include "workers/agent/stretch_executor.h"

#include <algorithm>
#include <utility>

#include <fmt/format.h>
#include "services/tasks/options.h"
#include "workers/agent/task_inputs.h"

namespace vorocast::agent {
namespace {

constexpr std::uint64_t kPatchSeed = 1;
/// Share of the time for reading, for the progress.
constexpr double kRead = 0.1;

/// The frame whose cells the stretch is followed by: from its middle half, so that no frame is far from it, the one whose cells have the largest
/// surface, as limbs are apart there. The earliest of equals. Where no frame of that half could be tessellated, any frame; null where there is none.
absl::StatusOr<const tasks::Input*> OwnFrame(const std::vector<const tasks::Input*>& inputs, const storage::ArtifactStore& store) {
  const tasks::Input* best = nullptr;
  double best_area = 0;
  const auto offer = [&](std::size_t begin, std::size_t end) -> absl::Status {
    for (std::size_t i = begin; i < end; ++i) {
      if (!inputs[i]->digest) continue;
      const absl::StatusOr<storage::CellsSummary> summary = storage::ReadCellsSummary(PathOf(*inputs[i], store));
      if (!summary.ok()) return base::Annotate(summary.status(), fmt::format("frame {}", inputs[i]->frame));
      if (best && summary->surface_area <= best_area) continue;
      best = inputs[i];
      best_area = summary->surface_area;
    }
    return absl::OkStatus();
  };
  const std::size_t quarter = inputs.size() / 4;
  RETURN_IF_ERROR(offer(quarter, inputs.size() - quarter));
  if (!best) RETURN_IF_ERROR(offer(0, inputs.size()));
  return best;
}

/// A stretch in which nothing was seen stands still: the template waits where it was, and is interpolated later.
geometry::Stretch StillStretch(const std::vector<const tasks::Input*>& inputs) {
  geometry::Stretch still;
  still.centroid.emplace_back(0, 0, 0);
  still.patch.push_back(0);
  still.motion.patch_count = 1;
  for (const tasks::Input* input : inputs) still.motion.frames.push_back(input->frame);
  still.frame = still.motion.frames.front();
  const std::size_t count = inputs.size();
  still.motion.world_from_template.resize(count);
  still.motion.state.assign(count, geometry::FrameState::kInterpolated);
  still.motion.residual.assign(count, 0);
  still.motion.confidence.assign(count, 0);
  return still;
}

absl::StatusOr<geometry::Template> OwnTemplate(const tasks::Input& frame, const storage::ArtifactStore& store, std::int32_t patches) {
  geometry::Template own;
  own.frame = frame.frame;
  ASSIGN_OR_RETURN(own.cells, storage::ReadCells(PathOf(frame, store)));
  ASSIGN_OR_RETURN(own.patch, tracking::ClusterPatches(own.cells, std::min(patches, static_cast<std::int32_t>(own.cells.size())), kPatchSeed));
  own.patch_count = *std::ranges::max_element(own.patch) + 1;
  return own;
}

}  // namespace

absl::Status StretchExecutor::Execute(const tasks::TaskSpec& spec, const storage::ArtifactStore& store, const std::filesystem::path& output,
                                      const base::Progress& progress) {
  ASSIGN_OR_RETURN(const auto options, OptionsOf<tasks::StretchOptions>(spec));
  const std::vector<const tasks::Input*> inputs = InputsOf(spec, "cells");
  if (inputs.empty()) return absl::InvalidArgumentError("a stretch needs at least one frame");
  ASSIGN_OR_RETURN(const tasks::Input* own_frame, OwnFrame(inputs, store));
  if (!own_frame) {
    base::Report(progress, 1);
    return storage::WriteStretch(output, StillStretch(inputs), ProvenanceOf(spec, kPatchSeed));
  }
  ASSIGN_OR_RETURN(const geometry::Template own, OwnTemplate(*own_frame, store, options.patches));
  ASSIGN_OR_RETURN(const std::vector<tracking::Observation> frames, CoarseObservationsOf(inputs, store, options.points, Part(progress, 0, kRead)));
  ASSIGN_OR_RETURN(const geometry::Stretch stretch,
                   tracking::FollowStretch(own, frames, {options.points, options.iterations}, Part(progress, kRead, 1)));
  return storage::WriteStretch(output, stretch, ProvenanceOf(spec, kPatchSeed));
}

}  // namespace vorocast::agent
