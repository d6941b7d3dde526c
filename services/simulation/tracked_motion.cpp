// SPDX-License-Identifier: AGPL-3.0-or-later
#include "services/simulation/tracked_motion.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace vorocast::simulation {

using geometry::Cells;
using geometry::Rigid3;
using geometry::TrackedTake;
using geometry::Vec3;

TrackedMotion::TrackedMotion(const TrackedTake& take) : model_(&take.model), cell_count_(take.cell_count()) {
  const std::vector<std::int32_t>& frames = take.patches.frames;
  for (const std::int32_t frame : frames) frame_time_.push_back((static_cast<double>(frame) - frames.front()) / take.frames_per_second);
  at_frame_.resize(frames.size() * cell_count_);
  for (std::size_t f = 0; f < frames.size(); ++f) {
    for (std::size_t c = 0; c < cell_count_; ++c) {
      const Rigid3 world_from_template = take.CellPose(f, c);
      at_frame_[f * cell_count_ + c] = {world_from_template.rotation, world_from_template * take.model.cells.centroid[c]};
    }
  }
}

void TrackedMotion::Sample(double time, std::vector<Rigid3>& world_from_cell) const {
  world_from_cell.resize(cell_count_);
  const std::size_t last = frame_time_.size() - 1;
  const auto after = static_cast<std::size_t>(std::ranges::upper_bound(frame_time_, time) - frame_time_.begin());
  if (after == 0 || after > last) {
    const auto held = at_frame_.begin() + static_cast<std::ptrdiff_t>((after == 0 ? 0 : last) * cell_count_);
    std::copy_n(held, cell_count_, world_from_cell.begin());
    return;
  }
  const double t = (time - frame_time_[after - 1]) / (frame_time_[after] - frame_time_[after - 1]);
  const Rigid3* from = &at_frame_[(after - 1) * cell_count_];
  const Rigid3* to = &at_frame_[after * cell_count_];
  for (std::size_t c = 0; c < cell_count_; ++c) world_from_cell[c] = t == 0 ? from[c] : geometry::Interpolate(from[c], to[c], t);
}

namespace {

absl::Status CheckCells(const Cells& cells) {
  const std::size_t n = cells.size();
  if (n == 0) return absl::InvalidArgumentError("tracked take: it has no cells");
  if (cells.volume.size() != n || cells.centroid.size() != n || cells.face_offset.size() != n + 1 || cells.vertex_offset.empty()) {
    return absl::InvalidArgumentError("tracked take: the template's arrays do not have one entry a cell");
  }
  const auto faces = static_cast<std::int64_t>(cells.vertex_offset.size()) - 1;
  const auto loops = static_cast<std::int64_t>(cells.vertex.size());
  if (cells.face_offset.front() != 0 || cells.face_offset.back() != faces || !std::ranges::is_sorted(cells.face_offset) ||
      cells.vertex_offset.front() != 0 || cells.vertex_offset.back() != loops || !std::ranges::is_sorted(cells.vertex_offset)) {
    return absl::InvalidArgumentError("tracked take: the template's face or vertex offsets do not fit");
  }
  const auto vertices = static_cast<std::int64_t>(cells.vertices.size());
  if (std::ranges::any_of(cells.vertex, [&](std::int32_t v) { return v < 0 || v >= vertices; })) {
    return absl::InvalidArgumentError("tracked take: a face of the template names a vertex that is not there");
  }
  if (cells.neighbour.size() != static_cast<std::size_t>(faces) ||
      std::ranges::any_of(cells.neighbour, [&](std::int32_t c) { return c < -1 || c >= static_cast<std::int64_t>(n); })) {
    return absl::InvalidArgumentError("tracked take: a face of the template names a neighbour that is not there");
  }
  if (cells.depth.size() != n || cells.component.size() != n || !std::ranges::all_of(cells.depth, [](double d) { return std::isfinite(d); })) {
    return absl::InvalidArgumentError("tracked take: the template's depths or components do not have one value a cell");
  }
  const auto finite = [](const Vec3& x) { return x.allFinite(); };
  if (!std::ranges::all_of(cells.vertices, finite) || !std::ranges::all_of(cells.centroid, finite) ||
      !std::ranges::all_of(cells.volume, [](double v) { return std::isfinite(v); })) {
    return absl::InvalidArgumentError("tracked take: the template has values that are not finite");
  }
  return absl::OkStatus();
}

}  // namespace

absl::Status CheckTake(const TrackedTake& take) {
  RETURN_IF_ERROR(CheckCells(take.model.cells));
  if (take.model.patch.size() != take.cell_count()) return absl::InvalidArgumentError("tracked take: the template does not have one patch a cell");
  const std::vector<std::int32_t>& frames = take.patches.frames;
  if (frames.empty()) return absl::InvalidArgumentError("tracked take: it has no frames");
  if (std::ranges::adjacent_find(frames, std::greater_equal<>()) != frames.end())
    return absl::InvalidArgumentError("tracked take: frame numbers do not ascend");
  if (!(take.frames_per_second > 0) || !std::isfinite(take.frames_per_second)) {
    return absl::InvalidArgumentError(fmt::format("tracked take: {} frames a second", take.frames_per_second));
  }
  const std::size_t poses = frames.size() * take.cell_count();
  if (take.cell_rotation.size() != poses || take.cell_translation.size() != poses) {
    return absl::InvalidArgumentError(fmt::format("tracked take: {} rotations and {} translations where {} frames of {} cells need {}",
                                                  take.cell_rotation.size(), take.cell_translation.size(), frames.size(), take.cell_count(), poses));
  }
  for (std::size_t i = 0; i < poses; ++i) {
    if (!take.cell_translation[i].allFinite() || !take.cell_rotation[i].allFinite() || !(take.cell_rotation[i].norm() > 0.5F)) {
      return absl::InvalidArgumentError(fmt::format("tracked take: frame {}, cell {}: the pose is not finite, or its rotation is no unit quaternion",
                                                    frames[i / take.cell_count()], i % take.cell_count()));
    }
  }
  return absl::OkStatus();
}

}  // namespace vorocast::simulation
