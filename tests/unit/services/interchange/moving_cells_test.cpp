// SPDX-License-Identifier: AGPL-3.0-or-later
#include "services/interchange/moving_cells.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include "services/storage/hdf5_artifacts.h"
#include "tests/unit/services/interchange/sample_moving_cells.h"
#include "tests/unit/services/storage/temporary_folder.h"

namespace vorocast::interchange {
namespace {

using storage::SomeProvenance;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

geometry::SimulatedTake ThreeCubesSimulated() {
  geometry::SimulatedTake take;
  take.effect_json = "{}";
  take.time = {0, 0.5};
  for (int i = 0; i < 6; ++i) {
    take.cell_rotation.emplace_back(1, 0, 0, 0);
    take.cell_translation.emplace_back(i, 0, 0);
    take.cell_state.push_back(geometry::CellState::kReleased);
  }
  return take;
}

TEST(MovingCells, AFolderGivesTheSimulatedTakeWhereThereIsOne) {
  const TemporaryFolder folder;
  ASSERT_EQ(storage::WriteTrackedTake(folder / "tracked.h5", storage::ThreeCubesTracked(), SomeProvenance()), absl::OkStatus());
  const auto tracked = ReadMovingCells(folder.path(), "");
  ASSERT_EQ(tracked.status(), absl::OkStatus());
  EXPECT_THAT(tracked->time, ElementsAre(0, 0.02, 0.06));  // frames 10, 11 and 13 at 50 a second
  ASSERT_EQ(storage::WriteSimulatedTake(folder / "simulated.h5", ThreeCubesSimulated(), SomeProvenance()), absl::OkStatus());
  const auto simulated = ReadMovingCells(folder.path(), "");
  ASSERT_EQ(simulated.status(), absl::OkStatus());
  EXPECT_THAT(simulated->time, ElementsAre(0, 0.5));
  EXPECT_EQ(simulated->State(1, 2), geometry::CellState::kReleased);
  EXPECT_EQ(simulated->Pose(1, 2).translation, geometry::Vec3(5, 0, 0));
}

TEST(MovingCells, SaysWhatIsMissing) {
  const TemporaryFolder folder;
  EXPECT_THAT(std::string(ReadMovingCells(folder.path(), "").status().message()), HasSubstr("neither simulated.h5 nor tracked.h5"));
  EXPECT_THAT(std::string(ReadMovingCells(folder / "no.h5", "").status().message()), HasSubstr("no such file"));
  ASSERT_EQ(storage::WriteSimulatedTake(folder / "simulated.h5", ThreeCubesSimulated(), SomeProvenance()), absl::OkStatus());
  EXPECT_THAT(std::string(ReadMovingCells(folder.path(), "").status().message()), HasSubstr("--tracked"));
}

TEST(MovingCells, RefusesTakesThatDoNotBelongTogether) {
  const TemporaryFolder folder;
  ASSERT_EQ(storage::WriteTrackedTake(folder / "tracked.h5", storage::ThreeCubesTracked(), SomeProvenance()), absl::OkStatus());
  ASSERT_EQ(storage::WriteSimulatedTake(folder / "simulated.h5", storage::TwoCubesAndABall(), SomeProvenance()), absl::OkStatus());
  EXPECT_EQ(ReadMovingCells(folder.path(), "").status().code(), absl::StatusCode::kInvalidArgument);
}

TEST(MovingCells, KeepsEverySecondInstant) {
  MovingCells take = ThreeCubesMoving();
  const geometry::Rigid3 last = take.Pose(2, 1);
  KeepEvery(2, take);
  EXPECT_THAT(take.time, ElementsAre(0, 0.06));
  EXPECT_EQ(take.Pose(1, 1).translation, last.translation);
  EXPECT_EQ(take.State(1, 2), geometry::CellState::kGone);
  EXPECT_EQ(take.object_pose[1].translation, geometry::Vec3(4, 2, 0));
}

}  // namespace
}  // namespace vorocast::interchange
