// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include "services/geometry/simulated_take.h"
#include "services/geometry/tracked_take.h"
#include "services/storage/hdf5_artifacts.h"

/// Small contents with distinct numbers everywhere, so that any two fields swapped or dropped are noticed.
namespace vorocast::storage {

/// `count` unit cubes in a row along x, sharing vertices, with surface points at the cubes' lower corners.
inline geometry::Cells CubesInARow(std::int32_t count) {
  geometry::Cells cells;
  for (std::int32_t x = 0; x <= count; ++x) {
    for (const double y : {0.0, 1.0}) {
      for (const double z : {0.0, 1.0}) cells.vertices.emplace_back(x, y, z);
    }
  }
  // A cube's corners are 4 x + 2 y + z from its first vertex.
  constexpr std::int32_t kFaces[6][4] = {{0, 1, 3, 2}, {4, 6, 7, 5}, {0, 4, 5, 1}, {2, 3, 7, 6}, {0, 2, 6, 4}, {1, 5, 7, 3}};
  cells.face_offset.push_back(0);
  cells.vertex_offset.push_back(0);
  for (std::int32_t c = 0; c < count; ++c) {
    cells.sites.emplace_back(c + 0.5, 0.5, 0.25);
    cells.volume.push_back(1 + 0.001 * c);
    cells.centroid.emplace_back(c + 0.5, 0.5, 0.5);
    cells.boundary.push_back(c % 2 == 0);
    cells.depth.push_back(0.5 + c);
    cells.component.push_back(0);
    for (int face = 0; face < 6; ++face) {
      for (const std::int32_t corner : kFaces[face]) cells.vertex.push_back(4 * c + corner);
      cells.vertex_offset.push_back(static_cast<std::int64_t>(cells.vertex.size()));
      cells.neighbour.push_back(face == 0 ? c - 1 : face == 1 && c + 1 < count ? c + 1 : -1);
    }
    cells.face_offset.push_back(static_cast<std::int64_t>(cells.neighbour.size()));
    cells.surface.positions.emplace_back(c, 0, 0.125);
    cells.surface.normals.emplace_back(0, -1, 0);
    cells.surface.colours.push_back({static_cast<std::uint8_t>(c), 20, 200});
  }
  cells.energy = 0.25 * count;
  cells.surface_area = 4 * count + 2;
  cells.iterations = 7;
  return cells;
}

inline geometry::Template ThreeCubes() { return {CubesInARow(3), 12, {0, 1, 1}, 2}; }

inline geometry::PoseTrack TwoPatchesThreeFrames() {
  geometry::PoseTrack track;
  track.frames = {10, 11, 13};
  track.patch_count = 2;
  for (int i = 0; i < 6; ++i) {
    const geometry::Quat turn(Eigen::AngleAxisd(0.1 * (i + 1), geometry::Vec3(1, 2, 3).normalized()));
    track.world_from_template.push_back({turn, geometry::Vec3(i, 0.5 * i, -0.125 * i)});
  }
  track.state = {geometry::FrameState::kTracked, geometry::FrameState::kInterpolated, geometry::FrameState::kTracked};
  track.residual = {0.001, 0.002, 0.003};
  track.confidence = {0.9, 0, 0.8};
  return track;
}

inline geometry::TrackedTake ThreeCubesTracked() {
  geometry::TrackedTake take;
  take.model = ThreeCubes();
  take.frames_per_second = 50;
  take.patches = TwoPatchesThreeFrames();
  for (int i = 0; i < 9; ++i) {
    take.cell_rotation.push_back(Eigen::Vector4f(1, 0.25f * static_cast<float>(i), 0.5f, -1).normalized());
    take.cell_translation.emplace_back(0.25 * i, 1, -0.5 * i);  // exact in single precision
  }
  return take;
}

inline geometry::SimulatedTake TwoCubesAndABall() {
  geometry::SimulatedTake take;
  take.effect_json = R"({"name":"release"})";
  take.time = {0, 0.04};
  for (int i = 0; i < 4; ++i) {
    take.cell_rotation.push_back(Eigen::Vector4f(0.5f * static_cast<float>(i), 1, 0, 2).normalized());
    take.cell_translation.emplace_back(i, 2 * i, 3 * i);
  }
  take.cell_state = {geometry::CellState::kRecalled, geometry::CellState::kRecalled, geometry::CellState::kReleased, geometry::CellState::kGone};
  take.objects.push_back({"ball", {{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}}, {{0, 2, 1}, {0, 1, 3}, {0, 3, 2}, {1, 2, 3}}, {}}});
  take.objects.push_back({"the ground", {{{0, 0, 0}, {9, 0, 0}, {0, 0, 9}}, {{0, 2, 1}}, {}}});
  for (int i = 0; i < 4; ++i) take.object_pose.push_back({geometry::Quat::Identity(), geometry::Vec3(0, i, 0)});
  return take;
}

/// The same with cells that shrink, copies at the second instant only, and a morph of two pairs, one of which grows from nothing.
inline geometry::SimulatedTake TwoCubesWithCopiesAndPairs() {
  geometry::SimulatedTake take = TwoCubesAndABall();
  take.cell_scale = {1, 0.75F, 0.5F, 0.25F};
  take.copies = {.offset = {0, 0, 3}, .copy = {0, 0, 2}, .cell = {0, 1, 1}, .scale = {1, 0.5F, 0.125F}};
  for (int row = 0; row < 3; ++row) {
    take.copies.rotation.push_back(Eigen::Vector4f(1, 0.5f * static_cast<float>(row), 0, -0.5f).normalized());
    take.copies.translation.emplace_back(static_cast<float>(row), -1.f, 0.5f * static_cast<float>(row));
  }
  take.morph.source = {1, -1};
  take.morph.target = {5, 0};
  take.morph.vertex_offset = {0, 4, 8};
  take.morph.from = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}, {0, 0, 0}, {0, 0, 0}, {0, 0, 0}, {0, 0, 0}};
  take.morph.to = {{-1, -1, -1}, {1, -1, -1}, {-1, 1, -1}, {-1, -1, 1}, {0, 0, 0}, {1, 0, 0}, {0, 2, 0}, {0, 0, 3}};
  take.morph.triangle_offset = {0, 4, 7};
  take.morph.triangles = {{0, 2, 1}, {0, 1, 3}, {0, 3, 2}, {1, 2, 3}, {0, 2, 1}, {0, 1, 3}, {1, 2, 3}};
  take.morph.blend = {0.25F, 0, 1, 0.5F};
  take.morph.scale = {0.875F, 1, 1, 1.125F};
  for (int i = 0; i < 4; ++i) {
    take.morph.rotation.push_back(Eigen::Vector4f(1, 0, 0.25f * static_cast<float>(i), -1).normalized());
    take.morph.translation.emplace_back(4.f, static_cast<float>(i), -2.f);
  }
  return take;
}

inline Provenance SomeProvenance() {
  return {"tessellate", std::string(64, 'a'), 3, R"({"cells":3,"up":"+y"})", 18446744073709551615ULL, {"frame:" + std::string(64, 'b'), "cells:-"}};
}

}  // namespace vorocast::storage
