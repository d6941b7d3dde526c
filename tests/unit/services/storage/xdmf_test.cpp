// SPDX-License-Identifier: AGPL-3.0-or-later
#include "services/storage/xdmf.h"

#include <cmath>
#include <fstream>
#include <sstream>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include "services/storage/hdf5_reader.h"
#include "tests/unit/services/storage/sample_takes.h"
#include "tests/unit/services/storage/temporary_folder.h"

namespace vorocast::storage {
namespace {

using ::testing::HasSubstr;

std::string Text(const std::filesystem::path& path) {
  std::ostringstream text;
  text << std::ifstream(path).rdbuf();
  return text.str();
}

std::size_t Count(const std::string& text, const std::string& part) {
  std::size_t count = 0;
  for (std::size_t at = text.find(part); at != std::string::npos; at = text.find(part, at + 1)) ++count;
  return count;
}

TEST(Xdmf, ShowsOneFramesCells) {
  const TemporaryFolder folder;
  ASSERT_EQ(WriteCells(folder / "cells & more.h5", CubesInARow(5), SomeProvenance()), absl::OkStatus());
  ASSERT_EQ(WriteXdmf(folder / "cells & more.h5", "", folder / "cells.xdmf"), absl::OkStatus());
  const std::string text = Text(folder / "cells.xdmf");
  EXPECT_THAT(text, HasSubstr("NumberOfElements=\"5\""));
  EXPECT_THAT(text, HasSubstr((folder / "cells &amp; more.h5").string() + ":/cells/centroid"));
  EXPECT_FALSE(std::filesystem::exists(folder / "cells.xdmf.h5"));
}

TEST(Xdmf, MovesCellsThroughATake) {
  const TemporaryFolder folder;
  geometry::TrackedTake take = ThreeCubesTracked();
  // Frame 1, cell 2: a quarter turn about z takes its centroid (2.5, 0.5, 0.5) to (-0.5, 2.5, 0.5), and then it moves by (1, 2, 3).
  const float half = static_cast<float>(std::sqrt(0.5));
  take.cell_rotation[5] = {half, 0, 0, half};
  take.cell_translation[5] = {1, 2, 3};
  ASSERT_EQ(WriteTrackedTake(folder / "tracked.h5", take, SomeProvenance()), absl::OkStatus());
  ASSERT_EQ(WriteXdmf(folder / "tracked.h5", "", folder / "tracked.xdmf"), absl::OkStatus());
  const std::string text = Text(folder / "tracked.xdmf");
  EXPECT_EQ(Count(text, "<Time "), 3u);
  EXPECT_THAT(text, HasSubstr("<Time Value=\"0.06\"/>"));  // frame 13 follows frame 10 at 50 frames a second
  EXPECT_THAT(text, HasSubstr(":/template/patch"));
  const Hdf5Reader moved = Hdf5Reader::Open(folder / "tracked.xdmf.h5").value();
  const std::vector<float> position = moved.Dataset<float>("/position/000001", {3, 3}).value();
  EXPECT_NEAR(position[6], 0.5, 1e-6);
  EXPECT_NEAR(position[7], 4.5, 1e-6);
  EXPECT_NEAR(position[8], 3.5, 1e-6);
}

TEST(Xdmf, ShowsStatesOfASimulation) {
  const TemporaryFolder folder;
  geometry::TrackedTake take = ThreeCubesTracked();
  ASSERT_EQ(WriteTrackedTake(folder / "tracked.h5", take, SomeProvenance()), absl::OkStatus());
  geometry::SimulatedTake simulated;
  simulated.time = {0, 0.5};
  for (std::size_t i = 0; i < 6; ++i) {
    simulated.cell_rotation.push_back(take.cell_rotation[i]);
    simulated.cell_translation.push_back(take.cell_translation[i]);
    simulated.cell_state.push_back(i == 4 ? geometry::CellState::kGone : geometry::CellState::kReleased);
  }
  ASSERT_EQ(WriteSimulatedTake(folder / "simulated.h5", simulated, SomeProvenance()), absl::OkStatus());
  ASSERT_EQ(WriteXdmf(folder / "simulated.h5", folder / "tracked.h5", folder / "simulated.xdmf"), absl::OkStatus());
  EXPECT_THAT(Text(folder / "simulated.xdmf"), HasSubstr("<Time Value=\"0.5\"/>"));
  const Hdf5Reader moved = Hdf5Reader::Open(folder / "simulated.xdmf.h5").value();
  EXPECT_EQ(moved.Dataset<std::uint8_t>("/state/000001", {3}).value(), (std::vector<std::uint8_t>{1, 2, 1}));
}

TEST(Xdmf, CopiesAndPairsAreCollectionsOfTheirOwn) {
  const TemporaryFolder folder;
  geometry::TrackedTake take = ThreeCubesTracked();
  ASSERT_EQ(WriteTrackedTake(folder / "tracked.h5", take, SomeProvenance()), absl::OkStatus());
  geometry::SimulatedTake simulated = TwoCubesWithCopiesAndPairs();
  simulated.cell_rotation.assign(6, {1, 0, 0, 0});
  simulated.cell_translation.assign(6, geometry::Vec3::Zero());
  simulated.cell_state.assign(6, geometry::CellState::kReleased);
  simulated.cell_scale = {1, 1, 1, 0.5F, 0.25F, 0.125F};
  // Copy row 2, cell 1: a quarter turn about z takes its centroid (1.5, 0.5, 0.5) to (-0.5, 1.5, 0.5), and then it moves by (2, -1, 1).
  const float half = static_cast<float>(std::sqrt(0.5));
  simulated.copies.rotation[2] = {half, 0, 0, half};
  ASSERT_EQ(WriteSimulatedTake(folder / "simulated.h5", simulated, SomeProvenance()), absl::OkStatus());
  ASSERT_EQ(WriteXdmf(folder / "simulated.h5", folder / "tracked.h5", folder / "simulated.xdmf"), absl::OkStatus());
  const std::string text = Text(folder / "simulated.xdmf");
  EXPECT_EQ(Count(text, "<Grid Name=\"cells\""), 2u);
  EXPECT_EQ(Count(text, "<Grid Name=\"copies\" GridType=\"Uniform\""), 1u);  // at the second instant only
  EXPECT_EQ(Count(text, "<Grid Name=\"pairs\" GridType=\"Uniform\""), 2u);
  EXPECT_EQ(Count(text, "CollectionType=\"Temporal\""), 3u);
  const Hdf5Reader moved = Hdf5Reader::Open(folder / "simulated.xdmf.h5").value();
  EXPECT_EQ(moved.Dataset<float>("/scale/000001", {3}).value(), (std::vector<float>{0.5F, 0.25F, 0.125F}));
  EXPECT_EQ(moved.Dataset<std::int32_t>("/copies_copy/000001", {3}).value(), (std::vector<std::int32_t>{0, 0, 2}));
  EXPECT_EQ(moved.Dataset<float>("/copies_scale/000001", {3}).value(), (std::vector<float>{1, 0.5F, 0.125F}));
  const std::vector<float> copies = moved.Dataset<float>("/copies_position/000001", {3, 3}).value();
  EXPECT_NEAR(copies[6], 1.5, 1e-6);
  EXPECT_NEAR(copies[7], 0.5, 1e-6);
  EXPECT_NEAR(copies[8], 1.5, 1e-6);
  EXPECT_FALSE(moved.Has("/copies_copy/000000"));
  EXPECT_EQ(moved.Dataset<std::int32_t>("/pairs_source/000000", {1}).value(), (std::vector<std::int32_t>{1}));
  EXPECT_EQ(moved.Dataset<std::int32_t>("/pairs_target/000001", {2}).value(), (std::vector<std::int32_t>{5, 0}));
  EXPECT_EQ(moved.Dataset<float>("/pairs_blend/000001", {2}).value(), (std::vector<float>{1, 0.5F}));
  EXPECT_EQ(moved.Dataset<float>("/pairs_position/000001", {2, 3}).value(), (std::vector<float>{4, 2, -2, 4, 3, -2}));
}

TEST(Xdmf, RefusesWhatHasNoCells) {
  const TemporaryFolder folder;
  ASSERT_EQ(WritePoseTrack(folder / "guide.h5", TwoPatchesThreeFrames(), SomeProvenance()), absl::OkStatus());
  EXPECT_EQ(WriteXdmf(folder / "guide.h5", "", folder / "guide.xdmf").code(), absl::StatusCode::kInvalidArgument);
}

}  // namespace
}  // namespace vorocast::storage
