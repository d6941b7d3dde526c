// SPDX-License-Identifier: AGPL-3.0-or-later
#include "workers/agent/template_executor.h"

#include <algorithm>
#include <utility>

#include <fmt/format.h>
#include "workers/agent/frame_cells.h"
#include "workers/agent/task_inputs.h"
#include "workers/tracking/tracking.h"

namespace vorocast::agent {
namespace {

constexpr std::int32_t kChoose = -1;
/// Share of the time before the patches, for the progress.
constexpr double kCells = 0.9;

/// The frame whose cells have the largest surface: limbs are apart there, and what touches is grown together nowhere. The earliest of equals.
absl::StatusOr<std::int32_t> ChooseFrame(const tasks::TaskSpec& spec, const storage::ArtifactStore& store) {
  std::int32_t best_frame = kChoose;
  double best_area = 0;
  for (const tasks::Input* input : InputsOf(spec, "cells")) {
    if (!input->digest) continue;
    absl::StatusOr<storage::CellsSummary> summary = storage::ReadCellsSummary(PathOf(*input, store));
    if (!summary.ok()) return base::Annotate(summary.status(), fmt::format("frame {}", input->frame));
    if (best_frame == kChoose || summary->surface_area > best_area) {
      best_frame = input->frame;
      best_area = summary->surface_area;
    }
  }
  if (best_frame == kChoose) return absl::FailedPreconditionError("no frame could be tessellated, so none can be the template");
  return best_frame;
}

absl::StatusOr<const tasks::Input*> FrameInput(const tasks::TaskSpec& spec, std::int32_t frame) {
  for (const tasks::Input* input : InputsOf(spec, "frame")) {
    if (input->frame == frame && input->digest) return input;
  }
  return absl::InvalidArgumentError(fmt::format("frame {} is to be the template but is not among the inputs", frame));
}

}  // namespace

absl::Status TemplateExecutor::Execute(const tasks::TaskSpec& spec, const storage::ArtifactStore& store, const std::filesystem::path& output,
                                       const base::Progress& progress) {
  ASSIGN_OR_RETURN(const auto options, OptionsOf<tasks::TemplateOptions>(spec));
  geometry::Template model;
  model.frame = options.frame;
  if (model.frame == kChoose) {
    ASSIGN_OR_RETURN(model.frame, ChooseFrame(spec, store));
  }
  ASSIGN_OR_RETURN(const tasks::Input* frame, FrameInput(spec, model.frame));
  ASSIGN_OR_RETURN(model.cells, CellsOfFrame(PathOf(*frame, store), options.tessellate, Part(progress, 0, kCells)));

  const std::int32_t patches = std::min(options.patches, static_cast<std::int32_t>(model.cells.size()));
  ASSIGN_OR_RETURN(model.patch, tracking::ClusterPatches(model.cells, patches, options.tessellate.seed));
  model.patch_count = *std::max_element(model.patch.begin(), model.patch.end()) + 1;
  return storage::WriteTemplate(output, model, ProvenanceOf(spec, options.tessellate.seed));
}

}  // namespace vorocast::agent
