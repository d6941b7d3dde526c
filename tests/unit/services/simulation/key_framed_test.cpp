// SPDX-License-Identifier: AGPL-3.0-or-later
#include "services/simulation/key_framed.h"

#include <gtest/gtest.h>

#include <limits>

#include "services/simulation/mask.h"
#include "services/simulation/release_schedule.h"
#include "tests/unit/services/simulation/synthetic_take.h"

namespace vorocast::simulation {
namespace {

constexpr double kNever = std::numeric_limits<double>::infinity();

TEST(KeyFramed, StraightBetweenKeysAndHeldOutside) {
  const Scalar value({{1, 10}, {2, 20}, {4, 0}});
  EXPECT_EQ(value.At(0), 10);
  EXPECT_EQ(value.At(1), 10);
  EXPECT_EQ(value.At(1.5), 15);
  EXPECT_EQ(value.At(2), 20);
  EXPECT_EQ(value.At(3), 10);
  EXPECT_EQ(value.At(9), 0);
  EXPECT_EQ(Scalar(3).At(7), 3);
}

TEST(KeyFramed, IntegralIsTheAreaBelow) {
  const Scalar value({{1, 10}, {2, 20}, {4, 0}});
  EXPECT_EQ(value.Integral(0), 0);
  EXPECT_EQ(value.Integral(0.5), 5);
  EXPECT_EQ(value.Integral(1), 10);
  EXPECT_EQ(value.Integral(2), 25);
  EXPECT_EQ(value.Integral(3), 40);
  EXPECT_EQ(value.Integral(5), 45);
  EXPECT_EQ(Scalar(3).Integral(2), 6);
  const Vector path({{0, geometry::Vec3(0, 0, 0)}, {2, geometry::Vec3(2, 0, 4)}});
  EXPECT_EQ(path.Integral(2), geometry::Vec3(2, 0, 4));
}

struct Block {
  Block() : Block(2, 10, 2) {}
  Block(int x, int y, int z)
      : take(testing::Animate(Connected(x, y, z), 2, 25, testing::Still)), motion(take), subject(take.model, motion, Vec3::Zero()) {}
  static testing::Cells Connected(int x, int y, int z) {
    testing::Cells cells = testing::CubeBlock(x, y, z, 0.04);
    testing::ConnectNeighbours(cells);
    return cells;
  }
  using Vec3 = geometry::Vec3;
  geometry::TrackedTake take;
  TrackedMotion motion;
  MaskSubject subject;
};

TEST(Mask, EverythingByDefault) {
  const Block block;
  for (const double weight : MaskWeights({}, block.subject)) EXPECT_EQ(weight, 1);
  for (const double weight : MaskWeights({.invert = true}, block.subject)) EXPECT_EQ(weight, 0);
}

TEST(Mask, ConditionsAreMultiplied) {
  Block block;
  block.take.model.patch[5] = 2;
  block.take.model.cells.component[7] = 1;
  const auto by_patch = MaskWeights({.patches = {{2, 9}}}, block.subject);
  const auto by_component = MaskWeights({.components = {{1}}}, block.subject);
  const auto both = MaskWeights({.components = {{1}}, .patches = {{2}}}, block.subject);
  for (std::size_t c = 0; c < by_patch.size(); ++c) {
    EXPECT_EQ(by_patch[c], c == 5);
    EXPECT_EQ(by_component[c], c == 7);
    EXPECT_EQ(both[c], 0);
  }
}

TEST(Mask, FallsOffSoftly) {
  const Block block;  // rows at heights 0, 1/9, … 1
  const auto weight = MaskWeights({.height = {0.5, 1}, .height_soft = 1.0 / 3}, block.subject);
  for (std::size_t c = 0; c < weight.size(); ++c) {
    const double height = static_cast<double>(c / 4) / 9;
    EXPECT_NEAR(weight[c], std::clamp(1 - 3 * (0.5 - height), 0.0, 1.0), 1e-12);
  }
  const auto painted = MaskWeights({.painted = {{.position_m = {0, 0.2, 0}, .radius_m = 0.05, .soft_m = 0.1}}}, block.subject);
  for (std::size_t c = 0; c < painted.size(); ++c) {
    const double away = (block.take.model.cells.centroid[c] - geometry::Vec3(0, 0.2, 0)).norm();
    EXPECT_NEAR(painted[c], std::clamp(1 - (away - 0.05) / 0.1, 0.0, 1.0), 1e-12);
  }
}

TEST(Release, ErosionGoesInAtItsSpeed) {
  const Block block(5, 5, 5);
  const std::vector<double>& depth = block.take.model.cells.depth;
  const ReleaseRule outside{.by = ReleaseByDepth{.start_s = 0.5, .speed_m_s = 0.1}};
  const ReleaseSchedule schedule = ScheduleRelease(block.motion, block.subject, {outside}, 10);
  for (std::size_t c = 0; c < depth.size(); ++c) {
    EXPECT_NEAR(schedule.release[c], 0.5 + depth[c] / 0.1, 1e-9);
    EXPECT_EQ(schedule.vanish[c], kNever);
  }
  const ReleaseRule inside{.vanish = true, .vanish_s = 0.4, .by = ReleaseByDepth{.from_outside = false, .speed_m_s = 0.1}};
  const ReleaseSchedule from_inside = ScheduleRelease(block.motion, block.subject, {inside}, 10);
  for (std::size_t c = 0; c < depth.size(); ++c) {
    EXPECT_NEAR(from_inside.vanish[c], (0.1 - depth[c]) / 0.1, 1e-9);  // the middle cell is 10 cm deep
    EXPECT_EQ(from_inside.vanish_s[c], 0.4);
    EXPECT_EQ(from_inside.release[c], kNever);
  }
}

TEST(Release, ErosionSpeedIsKeyFramed) {
  const Block block(5, 5, 5);
  const ReleaseRule rule{.by = ReleaseByDepth{.start_s = 1, .speed_m_s = Scalar({{0, 0}, {1, 0.1}, {2, 0}})}};  // 10 cm in all
  const ReleaseSchedule schedule = ScheduleRelease(block.motion, block.subject, {rule}, 10);
  for (std::size_t c = 0; c < block.take.model.cells.depth.size(); ++c) {
    const double depth = block.take.model.cells.depth[c];
    // 0.05 t² to 1 s, then 0.1 − 0.05 (2 − t)².
    const double since = depth <= 0.05 ? std::sqrt(depth / 0.05) : 2 - std::sqrt(std::max(0.0, 0.1 - depth) / 0.05);
    EXPECT_NEAR(schedule.release[c], 1 + since, 1e-6);
  }
}

TEST(Release, HeatGoesFromRowToRowAndMasksHold) {
  const Block block(1, 12, 1);
  ReleaseRule rule{.by = ReleaseByHeat{.start_s = 0.5, .source = {.height = {0.95, 1}}, .rate_s = 50, .threshold = 0.02}};
  const ReleaseSchedule schedule = ScheduleRelease(block.motion, block.subject, {rule}, 20);
  EXPECT_EQ(schedule.release[11], 0.5);  // the source itself
  for (std::size_t row = 0; row + 1 < 12; ++row) EXPECT_GT(schedule.release[row], schedule.release[row + 1]);
  EXPECT_LT(schedule.release[0], 20);  // a twelfth of the heat each is above the threshold
  rule.mask = {.height = {0.5, 1}};
  const ReleaseSchedule masked = ScheduleRelease(block.motion, block.subject, {rule}, 20);
  for (std::size_t row = 0; row < 12; ++row) EXPECT_EQ(masked.release[row], row < 6 ? kNever : schedule.release[row]);
  rule = {.by = ReleaseByHeat{.source = {.height = {0.95, 1}}, .rate_s = 50, .threshold = 0.2}};
  EXPECT_EQ(ScheduleRelease(block.motion, block.subject, {rule}, 20).release[0], kNever);  // spread too thin
  rule = {.by = ReleaseByHeat{.source = {.height = {0.95, 1}}, .held = true, .rate_s = 50, .threshold = 0.2}};
  EXPECT_LT(ScheduleRelease(block.motion, block.subject, {rule}, 20).release[0], 20);
}

}  // namespace
}  // namespace vorocast::simulation
