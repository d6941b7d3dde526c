// SPDX-License-Identifier: AGPL-3.0-or-later
#include "tests/fuzz/artifact_files.h"

#include <algorithm>
#include <cmath>

#include "services/storage/hdf5_artifacts.h"
#include "services/storage/truth.h"
#include "services/storage/xdmf.h"
#include "tests/fuzz/corpus_files.h"
#include "tests/fuzz/subject.h"
#include "tests/unit/services/storage/sample_takes.h"

namespace vorocast::fuzz {
namespace {

namespace fs = std::filesystem;

bool IsLength(double metres) { return std::isfinite(metres) && metres >= 0; }

geometry::SimulatedTake WithCopiesAndMorph() {
  geometry::SimulatedTake take = storage::TwoCubesAndABall();
  const Eigen::Vector4f still(1, 0, 0, 0);
  take.cell_scale = {1, 0.5F, 0.25F, 0};
  take.copies = {
      .offset = {0, 1, 3}, .copy = {0, 0, 1}, .cell = {0, 1, 0}, .rotation = {3, still}, .translation = {3, {1, 2, 3}}, .scale = {1, 0.5F, 0}};
  take.morph = {.source = {0, -1},
                .target = {-1, 0},
                .vertex_offset = {0, 3, 6},
                .from = {6, {1, 0, 0}},
                .to = {6, {0, 1, 0}},
                .triangle_offset = {0, 1, 2},
                .triangles = {{0, 1, 2}, {2, 1, 0}},
                .blend = {0, 0.5F, 1, 1},
                .scale = {1, 1, 1, 2},
                .rotation = {4, still},
                .translation = {4, {0, 1, 0}}};
  return take;
}

std::vector<std::string> Make() {
  const fs::path path = ArtifactFolder() / "made.h5";
  std::vector<std::string> files;
  const auto keep = [&](const absl::Status& written) {
    Require(written.ok(), "(a sample is refused by its writer)");
    files.push_back(ReadInput(path));
  };
  const storage::Provenance provenance = storage::SomeProvenance();
  geometry::PoseTrack poses = storage::TwoPatchesThreeFrames();
  geometry::Stretch stretch;
  stretch.motion = poses;
  stretch.centroid = {{0, 0, 0}, {1, 0, 0}, {2, 0, 0}};
  stretch.patch = {0, 1, 1};
  poses.cell_pose.assign(6, poses.world_from_template.front());
  keep(storage::WriteCells(path, storage::CubesInARow(2), provenance));
  keep(storage::WriteTemplate(path, storage::ThreeCubes(), provenance));
  keep(storage::WritePoseTrack(path, poses, provenance));
  keep(storage::WriteStretch(path, stretch, provenance));
  keep(storage::WriteTrackedTake(path, storage::ThreeCubesTracked(), provenance));
  keep(storage::WriteSimulatedTake(path, WithCopiesAndMorph(), provenance));
  keep(storage::WriteTruth(path, {.part = {0, 1}, .points = {2, {{0, 0, 0}, {1, 1, 1}}}}));
  return files;
}

void ReadCellsBothWays(const fs::path& path) {
  const auto cells = storage::ReadCells(path);
  const auto summary = storage::ReadCellsSummary(path);
  const auto observed = storage::ReadObservedCells(path);
  if (summary.ok()) {
    Require(std::isfinite(summary->energy) && std::isfinite(summary->surface_area) && summary->iterations >= 0, "a head that no cells have");
  }
  if (!cells.ok()) return;
  Require(summary.ok() && std::size_t(summary->cell_count) == cells->size(), "cells of which the head is refused, or says otherwise");
  Require(observed.ok() && observed->centroid.size() == cells->size(), "cells of which a part is refused");
}

void CheckSimulated(const geometry::SimulatedTake& take) {
  Require(IsLength(take.cell_penetration_m) && IsLength(take.object_penetration_m) && IsLength(take.ground_penetration_m), "a depth");
  const std::size_t rows = take.cell_state.size();
  const std::size_t cells = take.time.empty() ? 0 : rows / take.time.size();
  Require(take.cell_rotation.size() == rows && take.cell_translation.size() == rows, "cells without poses");
  for (const std::int32_t cell : take.copies.cell) Require(cell >= 0 && std::size_t(cell) < cells, "a copy of no cell");
  for (const std::int32_t copy : take.copies.copy) Require(copy >= 0, "a copy of a negative number");
  for (const std::int32_t cell : take.morph.target) Require(cell >= -1, "a morph into no cell");
  for (const auto& object : take.objects) {
    for (const auto& triangle : object.mesh.triangles) {
      for (const std::int32_t corner : triangle) Require(corner >= 0 && std::size_t(corner) < object.mesh.vertices.size(), "a corner");
    }
  }
}

void CheckTracked(const geometry::TrackedTake& take) {
  for (const std::int32_t patch : take.model.patch) Require(patch >= 0 && patch < take.patches.patch_count, "a cell without a patch");
  const std::size_t rows = take.patches.frames.size() * take.model.cells.size();
  Require(take.cell_rotation.size() == rows && take.cell_translation.size() == rows, "cells without poses");
}

}  // namespace

const ScratchFolder& ArtifactFolder() {
  static const ScratchFolder folder;
  return folder;
}

const std::vector<std::string>& SmallArtifacts() {
  static const std::vector<std::string> files = Make();
  return files;
}

void ReadEveryWay(const fs::path& path) {
  const bool checked = storage::CheckArtifact(path).ok();
  bool read = false;
  ReadCellsBothWays(path);
  read |= storage::ReadCells(path).ok();
  read |= storage::ReadTemplate(path).ok();
  if (const auto poses = storage::ReadPoseTrack(path); poses.ok()) {
    read = true;
    const std::size_t frames = poses->frames.size();
    Require(poses->world_from_template.size() == frames * std::size_t(poses->patch_count), "patches without poses");
  }
  if (const auto stretch = storage::ReadStretch(path); stretch.ok()) {
    read = true;
    Require(stretch->frame >= 0, "a negative frame");
    for (const std::int32_t patch : stretch->patch) Require(patch >= 0 && patch < stretch->motion.patch_count, "a cell without a patch");
  }
  if (const auto tracked = storage::ReadTrackedTake(path); tracked.ok()) {
    read = true;
    CheckTracked(*tracked);
  }
  if (const auto simulated = storage::ReadSimulatedTake(path); simulated.ok()) {
    read = true;
    CheckSimulated(*simulated);
  }
  Require(!checked || read, "a result that can be published, but not be read");
  if (const auto truth = storage::ReadTruth(path); truth.ok()) {
    for (const auto& points : truth->points) {
      Require(points.size() == truth->part.size(), "points without parts");
      for (const auto& point : points) Require(point.allFinite(), "a point that is nowhere");
    }
  }
  (void)storage::HoldsSimulatedTake(path);
  (void)storage::WriteXdmf(path, path, ArtifactFolder() / "view.xdmf");
}

}  // namespace vorocast::fuzz
