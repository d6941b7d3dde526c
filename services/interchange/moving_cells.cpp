// SPDX-License-Identifier: AGPL-3.0-or-later
#include "services/interchange/moving_cells.h"

#include <system_error>
#include <unordered_map>
#include <utility>

#include <fmt/format.h>

#include "services/storage/hdf5_artifacts.h"

namespace vorocast::interchange {
namespace {

namespace fs = std::filesystem;
using geometry::Rigid3;

bool Exists(const fs::path& path) {
  std::error_code error;
  return fs::exists(path, error);
}

absl::StatusOr<fs::path> TakeFile(const fs::path& take) {
  std::error_code error;
  if (!fs::is_directory(take, error)) {
    if (Exists(take)) return take;
    return absl::NotFoundError(
        fmt::format("{}: no such file or folder; give a tracked.h5, a simulated.h5, or the folder that a run left", take.string()));
  }
  for (const char* name : {"simulated.h5", "tracked.h5"}) {
    if (Exists(take / name)) return take / name;
  }
  return absl::NotFoundError(fmt::format("{}: holds neither simulated.h5 nor tracked.h5; give the folder that 'run' or 'fetch' left", take.string()));
}

MovingCells FromTracked(geometry::TrackedTake&& take) {
  MovingCells moving;
  moving.frames_per_second = take.frames_per_second;
  for (const std::int32_t frame : take.patches.frames) moving.time.push_back((frame - take.patches.frames.front()) / take.frames_per_second);
  moving.rotation = std::move(take.cell_rotation);
  moving.translation = std::move(take.cell_translation);
  moving.state.assign(moving.rotation.size(), geometry::CellState::kRecalled);
  moving.model = std::move(take.model);
  return moving;
}

/// Copies have as many rows at an instant as there are of them.
void KeepEveryOfCopies(std::size_t n, geometry::CellCopies& copies) {
  if (copies.offset.empty()) return;
  std::vector<std::int64_t> offset = {0};
  std::size_t kept = 0;
  for (std::size_t s = 0; s + 1 < copies.offset.size(); s += n) {
    for (auto row = static_cast<std::size_t>(copies.offset[s]); row < static_cast<std::size_t>(copies.offset[s + 1]); ++row, ++kept) {
      copies.copy[kept] = copies.copy[row];
      copies.cell[kept] = copies.cell[row];
      copies.rotation[kept] = copies.rotation[row];
      copies.translation[kept] = copies.translation[row];
      copies.scale[kept] = copies.scale[row];
    }
    offset.push_back(static_cast<std::int64_t>(kept));
  }
  copies.offset = std::move(offset);
  copies.copy.resize(kept);
  copies.cell.resize(kept);
  copies.rotation.resize(kept);
  copies.translation.resize(kept);
  copies.scale.resize(kept);
}

}  // namespace

Rigid3 MovingCells::Pose(std::size_t instant, std::size_t cell) const {
  const Eigen::Vector4f& q = rotation[instant * cell_count() + cell];
  return {geometry::Quat(q[0], q[1], q[2], q[3]).normalized(), translation[instant * cell_count() + cell]};
}

float MovingCells::Size(std::size_t instant, std::size_t cell) const {
  if (State(instant, cell) == geometry::CellState::kGone) return 0;
  return scale.empty() ? 1 : scale[instant * cell_count() + cell];
}

absl::StatusOr<MovingCells> ReadMovingCells(const fs::path& take, const fs::path& tracked) {
  ASSIGN_OR_RETURN(const fs::path path, TakeFile(take));
  ASSIGN_OR_RETURN(const bool is_simulated, storage::HoldsSimulatedTake(path));
  if (!is_simulated) {
    ASSIGN_OR_RETURN(geometry::TrackedTake shapes, storage::ReadTrackedTake(path));
    return FromTracked(std::move(shapes));
  }
  const fs::path beside = tracked.empty() ? path.parent_path() / "tracked.h5" : tracked;
  if (!Exists(beside)) {
    return absl::NotFoundError(fmt::format("{} holds no shapes; they are in the take that it was run on, and {} is not there: name it with --tracked",
                                           path.string(), beside.string()));
  }
  ASSIGN_OR_RETURN(geometry::TrackedTake shapes, storage::ReadTrackedTake(beside));
  ASSIGN_OR_RETURN(geometry::SimulatedTake simulated, storage::ReadSimulatedTake(path));
  MovingCells moving = FromTracked(std::move(shapes));
  if (simulated.cell_state.size() != simulated.time.size() * moving.cell_count()) {
    return absl::InvalidArgumentError(fmt::format("{} has not the cells of {}; give the take that it was run on", path.string(), beside.string()));
  }
  if (simulated.time.empty()) return absl::InvalidArgumentError(fmt::format("{} holds no instant; there is nothing to export", path.string()));
  moving.time = std::move(simulated.time);
  moving.rotation = std::move(simulated.cell_rotation);
  moving.translation = std::move(simulated.cell_translation);
  moving.state = std::move(simulated.cell_state);
  moving.scale = std::move(simulated.cell_scale);
  moving.copies = std::move(simulated.copies);
  moving.morph = std::move(simulated.morph);
  moving.objects = std::move(simulated.objects);
  moving.object_pose = std::move(simulated.object_pose);
  return moving;
}

void KeepEvery(std::size_t n, MovingCells& take) {
  // `row` values belong to one instant.
  const auto keep = [&](auto& values, std::size_t row) {
    std::size_t kept = 0;
    for (std::size_t s = 0; s < take.instant_count(); s += n) {
      for (std::size_t i = 0; i < row; ++i) values[kept++] = values[s * row + i];
    }
    values.resize(kept);
  };
  keep(take.rotation, take.cell_count());
  keep(take.translation, take.cell_count());
  keep(take.state, take.cell_count());
  if (!take.scale.empty()) keep(take.scale, take.cell_count());
  keep(take.object_pose, take.objects.size());
  KeepEveryOfCopies(n, take.copies);
  const std::size_t pairs = take.morph.source.size();
  keep(take.morph.blend, pairs);
  keep(take.morph.scale, pairs);
  keep(take.morph.rotation, pairs);
  keep(take.morph.translation, pairs);
  keep(take.time, 1);  // last: the others count by it
}

CellShape ShapeOfCell(const geometry::Cells& cells, std::size_t cell) {
  CellShape shape;
  std::unordered_map<std::int32_t, std::int32_t> local;  // only looked up, never walked
  for (std::int64_t f = cells.face_offset[cell]; f < cells.face_offset[cell + 1]; ++f) {
    const auto face = static_cast<std::size_t>(f);
    CellShape::Face& added = shape.faces.emplace_back();
    added.neighbour = cells.neighbour[face];
    added.skin = added.neighbour < 0;
    for (std::int64_t i = cells.vertex_offset[face]; i < cells.vertex_offset[face + 1]; ++i) {
      const std::int32_t vertex = cells.vertex[static_cast<std::size_t>(i)];
      const auto [at, is_new] = local.emplace(vertex, static_cast<std::int32_t>(shape.vertices.size()));
      if (is_new) shape.vertices.push_back(cells.vertices[static_cast<std::size_t>(vertex)] - cells.centroid[cell]);
      added.loop.push_back(at->second);
    }
  }
  return shape;
}

Rigid3 WorldFromShape(const MovingCells& take, std::size_t instant, std::size_t cell) {
  const Rigid3 pose = take.Pose(instant, cell);
  return {pose.rotation, pose * take.model.cells.centroid[cell]};
}

}  // namespace vorocast::interchange
