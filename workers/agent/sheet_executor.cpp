// SPDX-License-Identifier: AGPL-3.0-or-later
#include "workers/agent/sheet_executor.h"

#include <algorithm>
#include <deque>
#include <utility>

#include <fmt/format.h>
#include "services/capture/frame_reader.h"
#include "services/rendering/sheet.h"
#include "services/rendering/simulated_picture.h"
#include "services/tasks/options.h"
#include "workers/agent/task_inputs.h"

namespace vorocast::agent {
namespace {

/// Share of the time for reading, for the progress.
constexpr double kRead = 0.2;

/// At most `most` of 0 … count−1, the first and the last among them, evenly between.
std::vector<std::size_t> EvenlySpread(std::size_t count, std::int32_t most) {
  const auto chosen = std::min(count, static_cast<std::size_t>(most));
  std::vector<std::size_t> indices;
  for (std::size_t i = 0; i < chosen; ++i) indices.push_back(chosen == 1 ? 0 : i * (count - 1) / (chosen - 1));
  return indices;
}

/// One sheet in the making: what every stage needs.
struct Sheet {
  const tasks::TaskSpec& spec;
  const storage::ArtifactStore& store;
  const tasks::SheetOptions& options;
  const base::Progress& progress;

  rendering::SheetLayout Layout(const std::string& title) const { return {.picture_width = options.width, .title = title}; }

  /// The inputs of a role that are there, at most as many as there are to be pictures.
  std::vector<const tasks::Input*> Chosen(std::string_view role) const {
    std::vector<const tasks::Input*> inputs = InputsOf(spec, role);
    std::erase_if(inputs, [](const tasks::Input* input) { return !input->digest; });
    std::vector<const tasks::Input*> chosen;
    for (const std::size_t i : EvenlySpread(inputs.size(), options.pictures)) chosen.push_back(inputs[i]);
    return chosen;
  }
};

absl::StatusOr<rendering::Image> DrawPoints(const Sheet& sheet) {
  std::vector<rendering::PointsPicture> pictures;
  for (const tasks::Input* input : sheet.Chosen("frame")) {
    absl::StatusOr<capture::Frame> frame =
        capture::ReadFrame(PathOf(*input, sheet.store), {sheet.options.capture.metres_per_unit, sheet.options.capture.up});
    // The frame's own task tells what is wrong with it; the sheet shows the others.
    if (absl::IsInvalidArgument(frame.status()) || absl::IsDataLoss(frame.status())) continue;
    if (!frame.ok()) return frame.status();
    pictures.push_back({std::move(frame->points), fmt::format("frame {}", input->frame)});
  }
  if (pictures.empty()) return absl::FailedPreconditionError("no frame can be read, so there is nothing to draw");
  return rendering::RenderSheet(pictures, sheet.Layout("captured points"), Part(sheet.progress, kRead, 1));
}

absl::StatusOr<rendering::Image> DrawCells(const Sheet& sheet) {
  std::vector<rendering::CellsPicture> pictures;
  std::deque<geometry::Cells> kept;  // pictures point into it
  for (const tasks::Input* input : sheet.Chosen("cells")) {
    ASSIGN_OR_RETURN(geometry::Cells cells, storage::ReadCells(PathOf(*input, sheet.store)));
    kept.push_back(std::move(cells));
    pictures.push_back({.cells = &kept.back(), .label = fmt::format("frame {}", input->frame)});
  }
  geometry::Template model;
  if (const auto templates = sheet.Chosen("template"); !templates.empty()) {
    ASSIGN_OR_RETURN(model, storage::ReadTemplate(PathOf(*templates[0], sheet.store)));
    pictures.push_back({.cells = &model.cells, .patch = &model.patch, .label = fmt::format("template (frame {}), patches", model.frame)});
  }
  if (pictures.empty()) return absl::FailedPreconditionError("no frame has cells, so there is nothing to draw");
  return rendering::RenderSheet(pictures, sheet.Layout("cells"), Part(sheet.progress, kRead, 1));
}

absl::StatusOr<rendering::Image> DrawTracked(const Sheet& sheet) {
  ASSIGN_OR_RETURN(const std::filesystem::path path, PathOfOnly(sheet.spec, "tracked", sheet.store));
  ASSIGN_OR_RETURN(const geometry::TrackedTake take, storage::ReadTrackedTake(path));
  std::vector<rendering::CellsPicture> pictures;
  for (const std::size_t f : EvenlySpread(take.frame_count(), sheet.options.pictures)) {
    rendering::CellsPicture picture{.cells = &take.model.cells, .patch = &take.model.patch};
    for (std::size_t c = 0; c < take.cell_count(); ++c) picture.world_from_template.push_back(take.CellPose(f, c));
    const double time = (take.patches.frames[f] - take.patches.frames[0]) / take.frames_per_second;
    const bool interpolated = take.patches.state[f] == geometry::FrameState::kInterpolated;
    picture.label = fmt::format("frame {}, {:.2f} s{}", take.patches.frames[f], time, interpolated ? ", interpolated" : "");
    pictures.push_back(std::move(picture));
  }
  if (pictures.empty()) return absl::FailedPreconditionError("the take has no frame, so there is nothing to draw");
  return rendering::RenderSheet(pictures, sheet.Layout("tracked"), Part(sheet.progress, kRead, 1));
}

absl::StatusOr<rendering::Image> DrawSimulated(const Sheet& sheet) {
  ASSIGN_OR_RETURN(const std::filesystem::path tracked_path, PathOfOnly(sheet.spec, "tracked", sheet.store));
  ASSIGN_OR_RETURN(const geometry::TrackedTake tracked, storage::ReadTrackedTake(tracked_path));
  ASSIGN_OR_RETURN(const std::filesystem::path path, PathOfOnly(sheet.spec, "simulated", sheet.store));
  ASSIGN_OR_RETURN(const geometry::SimulatedTake take, storage::ReadSimulatedTake(path));
  const std::size_t n = tracked.cell_count();
  if (take.cell_state.size() != take.time.size() * n) {
    return absl::InvalidArgumentError("simulated.h5 has another number of cells than the tracked.h5 it is to be drawn with");
  }
  std::vector<rendering::CellsPicture> pictures;
  for (const std::size_t s : EvenlySpread(take.time.size(), sheet.options.pictures)) {
    pictures.push_back(rendering::PictureOf(tracked.model, take, s));
  }
  if (pictures.empty()) return absl::FailedPreconditionError("the simulation stored no instant, so there is nothing to draw");
  return rendering::RenderSheet(pictures, sheet.Layout("simulated"), Part(sheet.progress, kRead, 1));
}

absl::StatusOr<rendering::Image> Draw(const Sheet& sheet) {
  if (sheet.options.stage == "points") return DrawPoints(sheet);
  if (sheet.options.stage == "cells") return DrawCells(sheet);
  if (sheet.options.stage == "tracked") return DrawTracked(sheet);
  return DrawSimulated(sheet);
}

}  // namespace

absl::Status SheetExecutor::Execute(const tasks::TaskSpec& spec, const storage::ArtifactStore& store, const std::filesystem::path& output,
                                    const base::Progress& progress) {
  ASSIGN_OR_RETURN(const auto options, OptionsOf<tasks::SheetOptions>(spec));
  ASSIGN_OR_RETURN(const rendering::Image image, Draw({spec, store, options, progress}));
  return rendering::WritePng(output, image);
}

}  // namespace vorocast::agent
