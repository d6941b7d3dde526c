// SPDX-License-Identifier: AGPL-3.0-or-later
#include "services/storage/hdf5_artifacts.h"

#include <fstream>
#include <limits>
#include <sstream>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include "tests/unit/services/storage/sample_takes.h"
#include "tests/unit/services/storage/temporary_folder.h"

namespace vorocast::storage {
namespace {

using geometry::Cells;
using geometry::PoseTrack;
using geometry::Rigid3;
using geometry::SimulatedTake;
using geometry::TrackedTake;
using ::testing::HasSubstr;

std::string Bytes(const std::filesystem::path& path) {
  std::ostringstream bytes;
  bytes << std::ifstream(path, std::ios::binary).rdbuf();
  return bytes.str();
}

void ExpectSame(const Cells& actual, const Cells& expected) {
  EXPECT_EQ(actual.sites, expected.sites);
  EXPECT_EQ(actual.volume, expected.volume);
  EXPECT_EQ(actual.centroid, expected.centroid);
  EXPECT_EQ(actual.boundary, expected.boundary);
  EXPECT_EQ(actual.depth, expected.depth);
  EXPECT_EQ(actual.component, expected.component);
  EXPECT_EQ(actual.face_offset, expected.face_offset);
  EXPECT_EQ(actual.vertex_offset, expected.vertex_offset);
  EXPECT_EQ(actual.vertex, expected.vertex);
  EXPECT_EQ(actual.neighbour, expected.neighbour);
  EXPECT_EQ(actual.vertices, expected.vertices);
  EXPECT_EQ(actual.surface.positions, expected.surface.positions);
  EXPECT_EQ(actual.surface.normals, expected.surface.normals);
  EXPECT_EQ(actual.surface.colours, expected.surface.colours);
  EXPECT_EQ(actual.energy, expected.energy);
  EXPECT_EQ(actual.surface_area, expected.surface_area);
  EXPECT_EQ(actual.iterations, expected.iterations);
}

void ExpectSame(const std::vector<Rigid3>& actual, const std::vector<Rigid3>& expected) {
  ASSERT_EQ(actual.size(), expected.size());
  for (std::size_t i = 0; i < actual.size(); ++i) {
    EXPECT_EQ(actual[i].rotation.coeffs(), expected[i].rotation.coeffs());
    EXPECT_EQ(actual[i].translation, expected[i].translation);
  }
}

void ExpectSame(const PoseTrack& actual, const PoseTrack& expected) {
  EXPECT_EQ(actual.frames, expected.frames);
  EXPECT_EQ(actual.patch_count, expected.patch_count);
  EXPECT_EQ(actual.state, expected.state);
  EXPECT_EQ(actual.residual, expected.residual);
  EXPECT_EQ(actual.confidence, expected.confidence);
  ExpectSame(actual.world_from_template, expected.world_from_template);
}

TEST(Hdf5Artifacts, CellsComeBackAsTheyWere) {
  const TemporaryFolder folder;
  Cells cells = CubesInARow(5);
  ASSERT_EQ(WriteCells(folder / "cells.h5", cells, SomeProvenance()), absl::OkStatus());
  const absl::StatusOr<Cells> read = ReadCells(folder / "cells.h5");
  ASSERT_TRUE(read.ok()) << read.status();
  ExpectSame(*read, cells);

  cells.surface = {};
  ASSERT_EQ(WriteCells(folder / "no_surface.h5", cells, SomeProvenance()), absl::OkStatus());
  ExpectSame(ReadCells(folder / "no_surface.h5").value(), cells);
}

TEST(Hdf5Artifacts, TheHeadAndTheObservedPartAreThoseOfTheWhole) {
  const TemporaryFolder folder;
  const Cells cells = CubesInARow(4);
  ASSERT_EQ(WriteCells(folder / "cells.h5", cells, SomeProvenance()), absl::OkStatus());
  const CellsSummary summary = ReadCellsSummary(folder / "cells.h5").value();
  EXPECT_EQ(summary.cell_count, 4);
  EXPECT_EQ(summary.surface_area, cells.surface_area);
  EXPECT_EQ(summary.energy, cells.energy);
  EXPECT_EQ(summary.iterations, cells.iterations);
  const ObservedCells observed = ReadObservedCells(folder / "cells.h5").value();
  EXPECT_EQ(observed.surface.positions, cells.surface.positions);
  EXPECT_EQ(observed.surface.normals, cells.surface.normals);
  EXPECT_EQ(observed.centroid, cells.centroid);
  EXPECT_EQ(observed.depth, cells.depth);
}

TEST(Hdf5Artifacts, ATemplateComesBackAsItWas) {
  const TemporaryFolder folder;
  const geometry::Template model = ThreeCubes();
  ASSERT_EQ(WriteTemplate(folder / "template.h5", model, SomeProvenance()), absl::OkStatus());
  const absl::StatusOr<geometry::Template> read = ReadTemplate(folder / "template.h5");
  ASSERT_TRUE(read.ok()) << read.status();
  ExpectSame(read->cells, model.cells);
  EXPECT_EQ(read->frame, model.frame);
  EXPECT_EQ(read->patch, model.patch);
  EXPECT_EQ(read->patch_count, model.patch_count);
}

TEST(Hdf5Artifacts, PosesComeBackAsTheyWere) {
  const TemporaryFolder folder;
  ASSERT_EQ(WritePoseTrack(folder / "window.h5", TwoPatchesThreeFrames(), SomeProvenance()), absl::OkStatus());
  const absl::StatusOr<PoseTrack> read = ReadPoseTrack(folder / "window.h5");
  ASSERT_TRUE(read.ok()) << read.status();
  ExpectSame(*read, TwoPatchesThreeFrames());
}

TEST(Hdf5Artifacts, ATrackedTakeComesBackAsItWas) {
  const TemporaryFolder folder;
  const TrackedTake take = ThreeCubesTracked();
  ASSERT_EQ(WriteTrackedTake(folder / "tracked.h5", take, SomeProvenance()), absl::OkStatus());
  const absl::StatusOr<TrackedTake> read = ReadTrackedTake(folder / "tracked.h5");
  ASSERT_TRUE(read.ok()) << read.status();
  ExpectSame(read->model.cells, take.model.cells);
  EXPECT_EQ(read->model.patch, take.model.patch);
  EXPECT_EQ(read->frames_per_second, take.frames_per_second);
  ExpectSame(read->patches, take.patches);
  EXPECT_EQ(read->cell_rotation, take.cell_rotation);
  EXPECT_EQ(read->cell_translation, take.cell_translation);
}

TEST(Hdf5Artifacts, ASimulatedTakeComesBackAsItWas) {
  const TemporaryFolder folder;
  const SimulatedTake take = TwoCubesAndABall();
  ASSERT_EQ(WriteSimulatedTake(folder / "simulated.h5", take, SomeProvenance()), absl::OkStatus());
  const absl::StatusOr<SimulatedTake> read = ReadSimulatedTake(folder / "simulated.h5");
  ASSERT_TRUE(read.ok()) << read.status();
  EXPECT_EQ(read->effect_json, take.effect_json);
  EXPECT_EQ(read->time, take.time);
  EXPECT_EQ(read->cell_rotation, take.cell_rotation);
  EXPECT_EQ(read->cell_translation, take.cell_translation);
  EXPECT_EQ(read->cell_state, take.cell_state);
  ASSERT_EQ(read->objects.size(), 2u);
  EXPECT_EQ(read->objects[1].name, "the ground");
  EXPECT_EQ(read->objects[1].mesh.vertices, take.objects[1].mesh.vertices);
  EXPECT_EQ(read->objects[0].mesh.triangles, take.objects[0].mesh.triangles);
  ExpectSame(read->object_pose, take.object_pose);

  SimulatedTake without_objects = take;
  without_objects.objects.clear();
  without_objects.object_pose.clear();
  ASSERT_EQ(WriteSimulatedTake(folder / "bare.h5", without_objects, SomeProvenance()), absl::OkStatus());
  EXPECT_TRUE(ReadSimulatedTake(folder / "bare.h5")->objects.empty());
}

TEST(Hdf5Artifacts, ScalesCopiesAndMorphsComeBackAsTheyWere) {
  const TemporaryFolder folder;
  const SimulatedTake take = TwoCubesWithCopiesAndPairs();
  ASSERT_EQ(WriteSimulatedTake(folder / "simulated.h5", take, SomeProvenance()), absl::OkStatus());
  EXPECT_EQ(CheckArtifact(folder / "simulated.h5"), absl::OkStatus());
  const absl::StatusOr<SimulatedTake> read = ReadSimulatedTake(folder / "simulated.h5");
  ASSERT_TRUE(read.ok()) << read.status();
  EXPECT_EQ(read->cell_scale, take.cell_scale);
  EXPECT_EQ(read->copies.offset, take.copies.offset);
  EXPECT_EQ(read->copies.copy, take.copies.copy);
  EXPECT_EQ(read->copies.cell, take.copies.cell);
  EXPECT_EQ(read->copies.rotation, take.copies.rotation);
  EXPECT_EQ(read->copies.translation, take.copies.translation);
  EXPECT_EQ(read->copies.scale, take.copies.scale);
  EXPECT_EQ(read->morph.source, take.morph.source);
  EXPECT_EQ(read->morph.target, take.morph.target);
  EXPECT_EQ(read->morph.vertex_offset, take.morph.vertex_offset);
  EXPECT_EQ(read->morph.from, take.morph.from);
  EXPECT_EQ(read->morph.to, take.morph.to);
  EXPECT_EQ(read->morph.triangle_offset, take.morph.triangle_offset);
  EXPECT_EQ(read->morph.triangles, take.morph.triangles);
  EXPECT_EQ(read->morph.blend, take.morph.blend);
  EXPECT_EQ(read->morph.scale, take.morph.scale);
  EXPECT_EQ(read->morph.rotation, take.morph.rotation);
  EXPECT_EQ(read->morph.translation, take.morph.translation);

  // Without them, they are not there rather than empty.
  ASSERT_EQ(WriteSimulatedTake(folder / "plain.h5", TwoCubesAndABall(), SomeProvenance()), absl::OkStatus());
  const SimulatedTake plain = ReadSimulatedTake(folder / "plain.h5").value();
  EXPECT_TRUE(plain.cell_scale.empty() && plain.copies.offset.empty() && plain.morph.vertex_offset.empty());
}

TEST(Hdf5Artifacts, NoScalesCopiesOrMorphsAreWrittenThatCouldNotBe) {
  const TemporaryFolder folder;
  const auto refused = [&](auto spoil) {
    SimulatedTake take = TwoCubesWithCopiesAndPairs();
    spoil(take);
    return std::string(WriteSimulatedTake(folder / "bad.h5", take, SomeProvenance()).message());
  };
  EXPECT_THAT(refused([](SimulatedTake& t) { t.cell_scale[2] = 1.5F; }), HasSubstr("/cells/scale: entry 2 is not within 0 and 1"));
  EXPECT_THAT(refused([](SimulatedTake& t) { t.copies.cell[1] = 2; }), HasSubstr("/copies/cell: entry 1 is no cell"));
  EXPECT_THAT(refused([](SimulatedTake& t) { t.copies.offset[1] = 4; }), HasSubstr("/copies/offset"));
  EXPECT_THAT(refused([](SimulatedTake& t) { std::swap(t.copies.copy[0], t.copies.copy[2]); }), HasSubstr("/copies/copy: is not in the order"));
  EXPECT_THAT(refused([](SimulatedTake& t) { t.copies.cell[1] = 0; }), HasSubstr("/copies/copy: is not in the order"));  // one cell twice
  EXPECT_THAT(refused([](SimulatedTake& t) { t.morph.triangles[5][2] = 4; }), HasSubstr("/morph/triangles: has an index out of range"));
  EXPECT_THAT(refused([](SimulatedTake& t) { t.morph.blend.pop_back(); }), HasSubstr("/morph/blend: has 3 entries, not 4"));
  EXPECT_FALSE(std::filesystem::exists(folder / "bad.h5"));
}

TEST(Hdf5Artifacts, AnEffectOfTheLargestSizeThatJobsTakeComesBack) {
  const TemporaryFolder folder;
  SimulatedTake take = TwoCubesAndABall();
  take.effect_json = R"({"note":")" + std::string(1 << 20, 'x') + R"("})";  // sixteen times what HDF5 holds in an object's own header
  ASSERT_EQ(WriteSimulatedTake(folder / "simulated.h5", take, SomeProvenance()), absl::OkStatus());
  const absl::StatusOr<SimulatedTake> read = ReadSimulatedTake(folder / "simulated.h5");
  ASSERT_TRUE(read.ok()) << read.status();
  EXPECT_EQ(read->effect_json, take.effect_json);
  EXPECT_EQ(CheckArtifact(folder / "simulated.h5"), absl::OkStatus());
}

TEST(Hdf5Artifacts, ProvenanceOfAnySizeComesBack) {
  const TemporaryFolder folder;
  Provenance provenance = SomeProvenance();
  provenance.inputs.assign(6000, "cells:" + std::string(64, 'c'));
  provenance.options_json = R"({"note":")" + std::string(200'000, 'x') + R"("})";
  ASSERT_EQ(WriteCells(folder / "cells.h5", CubesInARow(1), provenance), absl::OkStatus());
  const absl::StatusOr<Provenance> read = ReadProvenance(folder / "cells.h5");
  ASSERT_TRUE(read.ok()) << read.status();
  EXPECT_EQ(read->kind, provenance.kind);
  EXPECT_EQ(read->key, provenance.key);
  EXPECT_EQ(read->kernel_version, provenance.kernel_version);
  EXPECT_EQ(read->options_json, provenance.options_json);
  EXPECT_EQ(read->seed, provenance.seed);
  EXPECT_EQ(read->inputs, provenance.inputs);

  provenance.inputs.clear();
  provenance.options_json.clear();
  ASSERT_EQ(WriteCells(folder / "empty.h5", CubesInARow(1), provenance), absl::OkStatus());
  EXPECT_TRUE(ReadProvenance(folder / "empty.h5")->inputs.empty());
  EXPECT_EQ(ReadProvenance(folder / "empty.h5")->options_json, "");
}

TEST(Hdf5Artifacts, TheSameContentIsTheSameBytes) {
  const TemporaryFolder folder;
  // The second file is written with other memory, other identifiers and at another time than the first.
  ASSERT_EQ(WriteTrackedTake(folder / "one.h5", ThreeCubesTracked(), SomeProvenance()), absl::OkStatus());
  ASSERT_EQ(WriteSimulatedTake(folder / "between.h5", TwoCubesAndABall(), SomeProvenance()), absl::OkStatus());
  const std::vector<char> noise(1 << 20, 'n');
  ASSERT_EQ(WriteTrackedTake(folder / "two.h5", ThreeCubesTracked(), SomeProvenance()), absl::OkStatus());
  EXPECT_EQ(Bytes(folder / "one.h5"), Bytes(folder / "two.h5"));

  TrackedTake other = ThreeCubesTracked();
  other.cell_translation[4].x() += 1;
  ASSERT_EQ(WriteTrackedTake(folder / "other.h5", other, SomeProvenance()), absl::OkStatus());
  EXPECT_NE(Bytes(folder / "one.h5"), Bytes(folder / "other.h5"));
}

TEST(Hdf5Artifacts, NothingIsWrittenThatCouldNotBeRead) {
  const TemporaryFolder folder;
  Cells cells = CubesInARow(2);
  cells.centroid[1].y() = std::numeric_limits<double>::quiet_NaN();
  const absl::Status status = WriteCells(folder / "cells.h5", cells, SomeProvenance());
  EXPECT_EQ(status.code(), absl::StatusCode::kInternal);
  EXPECT_THAT(std::string(status.message()), HasSubstr("/cells/centroid: entry 1 is not finite"));
  EXPECT_FALSE(std::filesystem::exists(folder / "cells.h5"));

  TrackedTake take = ThreeCubesTracked();
  take.cell_rotation.pop_back();
  EXPECT_THAT(std::string(WriteTrackedTake(folder / "t.h5", take, SomeProvenance()).message()), HasSubstr("/cells/rotation: has 8 entries, not 9"));
}

TEST(Hdf5Artifacts, AFolderThatIsNotThereIsAnErrorOfTheStore) {
  const absl::Status status = WriteCells("/nowhere/at/all/cells.h5", CubesInARow(1), SomeProvenance());
  EXPECT_EQ(status.code(), absl::StatusCode::kUnavailable);
  EXPECT_THAT(std::string(status.message()), HasSubstr("/nowhere/at/all/cells.h5"));
  EXPECT_EQ(ReadCells("/nowhere/at/all/cells.h5").status().code(), absl::StatusCode::kNotFound);
}

TEST(CheckArtifact, AcceptsEveryKindOfFile) {
  const TemporaryFolder folder;
  ASSERT_EQ(WriteCells(folder / "a.h5", CubesInARow(3), SomeProvenance()), absl::OkStatus());
  ASSERT_EQ(WriteTemplate(folder / "b.h5", ThreeCubes(), SomeProvenance()), absl::OkStatus());
  ASSERT_EQ(WritePoseTrack(folder / "c.h5", TwoPatchesThreeFrames(), SomeProvenance()), absl::OkStatus());
  ASSERT_EQ(WriteTrackedTake(folder / "d.h5", ThreeCubesTracked(), SomeProvenance()), absl::OkStatus());
  ASSERT_EQ(WriteSimulatedTake(folder / "e.h5", TwoCubesAndABall(), SomeProvenance()), absl::OkStatus());
  for (const char* name : {"a.h5", "b.h5", "c.h5", "d.h5", "e.h5"}) EXPECT_EQ(CheckArtifact(folder / name), absl::OkStatus());
  EXPECT_THAT(std::string(ReadCells(folder / "d.h5").status().message()), HasSubstr("holds \"tracked\", not \"cells\""));
}

TEST(CheckArtifact, RefusesAFileCutAnywhere) {
  const TemporaryFolder folder;
  ASSERT_EQ(WriteTrackedTake(folder / "whole.h5", ThreeCubesTracked(), SomeProvenance()), absl::OkStatus());
  const std::string bytes = Bytes(folder / "whole.h5");
  for (std::size_t length = 0; length < bytes.size(); length += 257) {
    std::ofstream(folder / "cut.h5", std::ios::binary) << bytes.substr(0, length);
    EXPECT_EQ(CheckArtifact(folder / "cut.h5").code(), absl::StatusCode::kDataLoss) << length;
  }
}

TEST(CheckArtifact, SurvivesAnyByteBeingWrong) {
  const TemporaryFolder folder;
  ASSERT_EQ(WriteCells(folder / "whole.h5", CubesInARow(1), SomeProvenance()), absl::OkStatus());
  const std::string bytes = Bytes(folder / "whole.h5");
  for (std::size_t place = 0; place < bytes.size(); place += 13) {
    std::string damaged = bytes;
    damaged[place] = static_cast<char>(~damaged[place]);
    std::ofstream(folder / "damaged.h5", std::ios::binary) << damaged;
    const absl::Status status = CheckArtifact(folder / "damaged.h5");  // may pass: a coordinate can have any value
    EXPECT_TRUE(status.ok() || status.code() == absl::StatusCode::kDataLoss) << status;
  }
}

}  // namespace
}  // namespace vorocast::storage
