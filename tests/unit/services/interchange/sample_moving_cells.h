// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <string>
#include <vector>

#include "services/interchange/moving_cells.h"
#include "tests/unit/services/storage/sample_takes.h"

namespace vorocast::interchange {

/// Three unit cubes in a row at three instants: the first stays and never moves, the second is released after the first instant and turns, the third
/// is gone at the last. A tetrahedron rises beside them.
inline MovingCells ThreeCubesMoving() {
  MovingCells take;
  take.model = storage::ThreeCubes();
  take.frames_per_second = 50;
  take.time = {0, 0.02, 0.06};
  for (int instant = 0; instant < 3; ++instant) {
    for (int cell = 0; cell < 3; ++cell) {
      const double angle = cell == 0 ? 0 : 1.2 * instant * cell;  // beyond half a turn, where the quaternion's sign matters
      const geometry::Quat turn(Eigen::AngleAxisd(angle, geometry::Vec3(1, 2, 2) / 3));
      take.rotation.emplace_back(static_cast<float>(turn.w()), static_cast<float>(turn.x()), static_cast<float>(turn.y()),
                                 static_cast<float>(turn.z()));
      take.translation.emplace_back(cell == 0 ? 0 : 0.25 * instant, 0.5 * cell, 0);
    }
  }
  using enum geometry::CellState;
  take.state = {kRecalled, kRecalled, kRecalled, kRecalled, kReleased, kRecalled, kRecalled, kReleased, kGone};
  take.objects = {storage::TwoCubesAndABall().objects[0]};
  for (int instant = 0; instant < 3; ++instant) take.object_pose.push_back({geometry::Quat::Identity(), geometry::Vec3(4, instant, 0)});
  return take;
}

/// The same with all that effects can add. Cells shrink; copy 0 of the cells 0 and 2 comes at the second instant, at half size, and cell 2's is gone
/// at the third; copy 4 of cell 1 is there at the last instant only. The corner tetrahedron of pair 0 turns into one of twice its size, at a quarter
/// of the way at the second instant and arrived at the third; pair 1 grows from nothing at the last instant.
inline MovingCells ThreeCubesWithCopiesAndPairs() {
  MovingCells take = ThreeCubesMoving();
  take.scale = {1, 1, 1, 0.75F, 0.5F, 1, 0.5F, 0.25F, 1};
  geometry::CellCopies& copies = take.copies;
  copies.offset = {0, 0, 2, 4};
  copies.copy = {0, 0, 0, 4};
  copies.cell = {0, 2, 0, 1};
  copies.scale = {0.5F, 1, 0.25F, 1};
  for (int row = 0; row < 4; ++row) {
    copies.rotation.push_back(Eigen::Vector4f(1, 0.3F * static_cast<float>(row), -0.2F, 0.1F).normalized());
    copies.translation.emplace_back(-3.F, 0.5F * static_cast<float>(row), 2.F);
  }
  geometry::CellMorphs& morph = take.morph;
  morph.source = {1, -1};
  morph.target = {7, 3};
  morph.vertex_offset = {0, 4, 8};
  morph.from = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}, {0, 0, 0}, {0, 0, 0}, {0, 0, 0}, {0, 0, 0}};
  morph.to = {{-1, -1, -1}, {1, -1, -1}, {-1, 1, -1}, {-1, -1, 1}, {0, 0, 0}, {1, 0, 0}, {0, 2, 0}, {0, 0, 3}};
  morph.triangle_offset = {0, 4, 8};
  morph.triangles = {{0, 2, 1}, {0, 1, 3}, {0, 3, 2}, {1, 2, 3}, {0, 2, 1}, {0, 1, 3}, {0, 3, 2}, {1, 2, 3}};
  morph.blend = {0, 0, 0.25F, 0, 1, 0.5F};
  morph.scale = {1, 1, 0.875F, 1, 1, 1.125F};
  for (int i = 0; i < 6; ++i) {
    morph.rotation.push_back(Eigen::Vector4f(1, 0, 0.4F * static_cast<float>(i), -0.3F).normalized());
    morph.translation.emplace_back(5.F, 1.F + static_cast<float>(i), -2.F);
  }
  return take;
}

/// A polyhedron in the world as the take's own numbers put it, worked out without what exporters use.
struct PlacedShape {
  std::string name;
  std::vector<geometry::Vec3> corners;  // in the order of the shape's vertices
};
inline geometry::Vec3 Placed(const Eigen::Vector4f& q, const geometry::Vec3& x, const geometry::Vec3& t) {
  // R v = v + 2 u × (u × v + w v)
  const geometry::Vec3 u(q[1], q[2], q[3]);
  return x + 2 * u.cross(u.cross(x) + static_cast<double>(q[0]) * x) + t;
}
/// Everything that is there at an instant.
inline std::vector<PlacedShape> EverythingAt(const MovingCells& take, std::size_t instant) {
  std::vector<PlacedShape> all;
  const std::size_t n = take.cell_count();
  const auto cube = [&](std::size_t cell, const Eigen::Vector4f& q, const geometry::Vec3& t, double scale) {
    std::vector<geometry::Vec3> corners;
    const geometry::Vec3 centre(static_cast<double>(cell) + 0.5, 0.5, 0.5);
    for (const geometry::Vec3& v : ShapeOfCell(take.model.cells, cell).vertices) corners.push_back(Placed(q, centre + scale * v, t));
    return corners;
  };
  for (std::size_t c = 0; c < n; ++c) {
    const std::size_t i = instant * n + c;
    if (take.state[i] == geometry::CellState::kGone) continue;
    all.push_back({"cell_0000" + std::to_string(c), cube(c, take.rotation[i], take.translation[i], take.scale.empty() ? 1 : take.scale[i])});
  }
  for (std::int64_t r = take.copies.offset[instant]; r < take.copies.offset[instant + 1]; ++r) {
    const auto row = static_cast<std::size_t>(r);
    const std::int32_t cell = take.copies.cell[row];
    all.push_back(
        {"copy_00" + std::to_string(take.copies.copy[row]) + "_cell_0000" + std::to_string(cell),
         cube(static_cast<std::size_t>(cell), take.copies.rotation[row], take.copies.translation[row].cast<double>(), take.copies.scale[row])});
  }
  for (std::size_t p = 0; p < take.morph.source.size(); ++p) {
    const std::size_t i = instant * take.morph.source.size() + p;
    const double blend = take.morph.blend[i];
    if (blend == 0) continue;
    PlacedShape& shape = all.emplace_back();
    shape.name = "pair_0000" + std::to_string(p);
    for (std::size_t v = 4 * p; v < 4 * p + 4; ++v) {
      const geometry::Vec3 x = take.morph.scale[i] * ((1 - blend) * take.morph.from[v] + blend * take.morph.to[v]);
      shape.corners.push_back(Placed(take.morph.rotation[i], x, take.morph.translation[i].cast<double>()));
    }
  }
  return all;
}

}  // namespace vorocast::interchange
