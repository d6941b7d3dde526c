// SPDX-License-Identifier: AGPL-3.0-or-later
#include "services/rendering/film_take.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace vorocast::rendering {
namespace {

using geometry::Rigid3;
using geometry::Vec3;

constexpr std::size_t kBoundsFramesMax = 60;  // so many frames, evenly, say where the performer goes

Rigid3 PoseFrom(const Eigen::Vector4f& q, const Vec3& translation) { return {geometry::Quat(q[0], q[1], q[2], q[3]).normalized(), translation}; }

Motion Between(const Rigid3& now, const Rigid3& next, double shutter) { return {now, geometry::Interpolate(now, next, shutter), next}; }

/// The row of the same copy of the same cell at the next instant, or `row` itself where it has vanished.
std::size_t NextRow(const geometry::CellCopies& copies, std::size_t row, std::size_t step) {
  const auto key = [&](std::size_t i) { return std::pair(copies.copy[i], copies.cell[i]); };
  auto low = static_cast<std::size_t>(copies.offset[step]);
  const auto end = static_cast<std::size_t>(copies.offset[step + 1]);
  for (auto high = end; low < high;) {
    const std::size_t middle = (low + high) / 2;
    if (key(middle) < key(row)) {
      low = middle + 1;
    } else {
      high = middle;
    }
  }
  return low < end && key(low) == key(row) ? low : row;
}

void AddCopies(const geometry::CellCopies& copies, std::size_t step, std::size_t next, double shutter, FilmSubject& subject) {
  if (copies.offset.empty()) return;
  const auto pose = [&](std::size_t row) { return PoseFrom(copies.rotation[row], copies.translation[row].cast<double>()); };
  for (auto row = static_cast<std::size_t>(copies.offset[step]); row < static_cast<std::size_t>(copies.offset[step + 1]); ++row) {
    subject.copies.push_back({copies.cell[row], Between(pose(row), pose(NextRow(copies, row, next)), shutter), copies.scale[row]});
  }
}

/// A pair keeps its source's colour; what grows from nothing has that of the cell with its number.
void AddMorphs(const geometry::CellMorphs& morph, std::size_t step, std::size_t next, double shutter, FilmSubject& subject) {
  const std::size_t pairs = morph.source.size();
  for (std::size_t p = 0; p < pairs; ++p) {
    const std::size_t i = step * pairs + p;
    const double blend = morph.blend[i];
    if (blend == 0) continue;
    const std::size_t j = morph.blend[next * pairs + p] == 0 ? i : next * pairs + p;
    FilmShape& shape = subject.shapes.emplace_back();
    shape.cell = morph.source[p] >= 0 ? morph.source[p] : static_cast<std::int32_t>(p % subject.cells->size());
    shape.motion = Between(PoseFrom(morph.rotation[i], morph.translation[i].cast<double>()),
                           PoseFrom(morph.rotation[j], morph.translation[j].cast<double>()), shutter);
    for (auto v = static_cast<std::size_t>(morph.vertex_offset[p]); v < static_cast<std::size_t>(morph.vertex_offset[p + 1]); ++v) {
      shape.mesh.vertices.emplace_back(morph.scale[i] * ((1 - blend) * morph.from[v] + blend * morph.to[v]));
    }
    shape.mesh.triangles.assign(morph.triangles.begin() + morph.triangle_offset[p], morph.triangles.begin() + morph.triangle_offset[p + 1]);
  }
}

}  // namespace

FilmSubject SubjectOf(const geometry::Template& model, const geometry::SimulatedTake& take, const std::vector<geometry::Vec3f>& colours,
                      std::size_t step, double shutter) {
  const std::size_t n = model.cells.size();
  const std::size_t m = take.objects.size();
  const std::size_t next = std::min(step + 1, take.time.size() - 1);
  FilmSubject subject;
  subject.cells = &model.cells;
  subject.patch = &model.patch;
  subject.colour = colours.empty() ? nullptr : &colours;
  if (next > step) subject.seconds_per_picture = take.time[next] - take.time[step];
  for (std::size_t c = 0; c < n; ++c) {
    const std::size_t i = step * n + c;
    const std::size_t j = next * n + c;
    subject.motion.push_back(
        Between(PoseFrom(take.cell_rotation[i], take.cell_translation[i]), PoseFrom(take.cell_rotation[j], take.cell_translation[j]), shutter));
    subject.state.push_back(take.cell_state[i]);
    if (!take.cell_scale.empty()) subject.scale.push_back(take.cell_scale[i]);
  }
  AddCopies(take.copies, step, next, shutter, subject);
  AddMorphs(take.morph, step, next, shutter, subject);
  for (std::size_t o = 0; o < m; ++o) {
    subject.objects.emplace_back(&take.objects[o], Between(take.object_pose[step * m + o], take.object_pose[next * m + o], shutter));
  }
  return subject;
}

geometry::SimulatedTake AsSimulated(const geometry::TrackedTake& take) {
  geometry::SimulatedTake simulated;
  for (const std::int32_t frame : take.patches.frames) simulated.time.push_back((frame - take.patches.frames.front()) / take.frames_per_second);
  simulated.cell_rotation = take.cell_rotation;
  simulated.cell_translation = take.cell_translation;
  simulated.cell_state.assign(take.cell_rotation.size(), geometry::CellState::kRecalled);
  return simulated;
}

Bounds BoundsOf(const geometry::TrackedTake& take, double& azimuth_deg) {
  const std::size_t frames = std::min(take.frame_count(), kBoundsFramesMax);
  Bounds all;
  std::vector<Bounds> each;
  for (std::size_t i = 0; i < frames; ++i) {
    const std::size_t f = frames == 1 ? 0 : i * (take.frame_count() - 1) / (frames - 1);
    Bounds& one = each.emplace_back();
    for (std::size_t c = 0; c < take.cell_count(); ++c) {
      one.centres.push_back((take.CellPose(f, c) * take.model.cells.centroid[c]).cast<float>());
      // The radius of a ball of the cell's volume.
      one.radii.push_back(static_cast<float>(std::cbrt(0.75 / M_PI * take.model.cells.volume[c])));
    }
    all.centres.insert(all.centres.end(), one.centres.begin(), one.centres.end());
    all.radii.insert(all.radii.end(), one.radii.begin(), one.radii.end());
  }
  azimuth_deg = ChooseAzimuth(each);
  return all;
}

}  // namespace vorocast::rendering
