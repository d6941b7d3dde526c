// SPDX-License-Identifier: AGPL-3.0-or-later
#include "services/rendering/simulated_picture.h"

#include <fmt/format.h>

namespace vorocast::rendering {
namespace {

geometry::Quat RotationOf(const Eigen::Vector4f& q) { return geometry::Quat(q[0], q[1], q[2], q[3]).normalized(); }

void AddCopies(const geometry::CellCopies& copies, std::size_t step, CellsPicture& picture) {
  if (copies.offset.empty()) return;
  for (auto i = static_cast<std::size_t>(copies.offset[step]); i < static_cast<std::size_t>(copies.offset[step + 1]); ++i) {
    const geometry::Rigid3 pose{RotationOf(copies.rotation[i]), copies.translation[i].cast<double>()};
    picture.copies.push_back({.cell = copies.cell[i], .world_from_template = pose, .scale = copies.scale[i]});
  }
}

/// A pair keeps its source's colour; what grows from nothing has that of the cell with its number.
void AddMorphs(const geometry::CellMorphs& morph, std::size_t step, std::size_t cells, CellsPicture& picture) {
  const std::size_t pairs = morph.source.size();
  for (std::size_t p = 0; p < pairs; ++p) {
    const std::size_t i = step * pairs + p;
    const double blend = morph.blend[i];
    if (blend == 0) continue;
    const geometry::Quat rotation = RotationOf(morph.rotation[i]);
    LooseShape shape{.middle = morph.translation[i].cast<double>()};
    shape.colour_of = morph.source[p] >= 0 ? morph.source[p] : static_cast<std::int32_t>(p % cells);
    for (auto v = static_cast<std::size_t>(morph.vertex_offset[p]); v < static_cast<std::size_t>(morph.vertex_offset[p + 1]); ++v)
      shape.mesh.vertices.emplace_back(rotation * (morph.scale[i] * ((1 - blend) * morph.from[v] + blend * morph.to[v])));
    shape.mesh.triangles.assign(morph.triangles.begin() + morph.triangle_offset[p], morph.triangles.begin() + morph.triangle_offset[p + 1]);
    picture.shapes.push_back(std::move(shape));
  }
}

}  // namespace

CellsPicture PictureOf(const geometry::Template& model, const geometry::SimulatedTake& take, std::size_t step) {
  const std::size_t n = model.cells.size();
  const std::size_t m = take.objects.size();
  CellsPicture picture{.cells = &model.cells, .patch = &model.patch, .label = fmt::format("{:.2f} s", take.time[step])};
  for (std::size_t i = step * n; i < (step + 1) * n; ++i) {
    picture.world_from_template.push_back({RotationOf(take.cell_rotation[i]), take.cell_translation[i]});
    picture.state.push_back(take.cell_state[i]);
    if (!take.cell_scale.empty()) picture.scale.push_back(take.cell_scale[i]);
  }
  AddCopies(take.copies, step, picture);
  AddMorphs(take.morph, step, n, picture);
  for (std::size_t o = 0; o < m; ++o) picture.objects.emplace_back(&take.objects[o].mesh, take.object_pose[step * m + o]);
  return picture;
}

}  // namespace vorocast::rendering
