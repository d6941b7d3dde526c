// SPDX-License-Identifier: AGPL-3.0-or-later
// Real captures, where they are at hand: people stand upright and have a person's height.
#include <gtest/gtest.h>

#include <cstdlib>

#include "services/capture/capture.h"
#include "services/capture/estimate_normals.h"
#include "services/capture/frame_reader.h"

namespace vorocast::capture {
namespace {

using geometry::Vec3;

struct RealCapture {
  const char* folder;
  const char* unit;
  const char* up;
};

std::filesystem::path DataFolder() {
  if (const char* set = std::getenv("VOROCAST_DATA")) return set;
  return std::filesystem::path(VOROCAST_SOURCE_DIR) / ".." / "shared" / "data";
}

class RealCaptures : public ::testing::TestWithParam<RealCapture> {};

TEST_P(RealCaptures, HoldAnUprightPerson) {
  const std::filesystem::path folder = DataFolder() / GetParam().folder;
  if (!std::filesystem::exists(folder)) GTEST_SKIP() << folder << " is absent; set VOROCAST_DATA to the folder of the captures";
  const auto capture = OpenCapture(folder, {.unit = GetParam().unit, .up = GetParam().up});
  ASSERT_TRUE(capture.ok()) << capture.status();
  for (std::size_t i = 0; i < capture->frames.size(); i += 10) {
    const auto frame = ReadFrame(capture->frames[i].path, {.metres_per_unit = capture->metres_per_unit, .up = capture->up});
    ASSERT_TRUE(frame.ok()) << frame.status();
    geometry::Box3 box;
    for (const Vec3& p : frame->points.positions) box.extend(p);
    EXPECT_GT(box.sizes().y(), 1.4);
    EXPECT_LT(box.sizes().y(), 2.1);
    EXPECT_GT(Outwardness(frame->points.positions, frame->points.normals), 0.1);
    if (i > 0) continue;
    // Upright: all three start with their arms down, so that what is on top is narrow, a head, and not two feet set apart.
    geometry::Box3 top;
    for (const Vec3& p : frame->points.positions) {
      if (p.y() > box.max().y() - 0.12) top.extend(p);
    }
    EXPECT_LT(top.sizes().x(), 0.35);
    EXPECT_LT(top.sizes().z(), 0.35);
  }
}

INSTANTIATE_TEST_SUITE_P(All, RealCaptures,
                         ::testing::Values(RealCapture{"kinoptic", "cm", "-y"}, RealCapture{"crane", "m", "+y"}, RealCapture{"liam", "mm", "+y"}),
                         [](const auto& test) { return std::string(test.param.folder); });

// The normals that a capture came with judge those that are estimated from its points alone.
TEST(RealNormals, AreFoundAgainFromThePositions) {
  const std::filesystem::path folder = DataFolder() / "kinoptic";
  if (!std::filesystem::exists(folder)) GTEST_SKIP() << folder << " is absent; set VOROCAST_DATA to the folder of the captures";
  const auto capture = OpenCapture(folder, {.unit = "cm", .up = "-y"});
  ASSERT_TRUE(capture.ok()) << capture.status();
  const auto frame = ReadFrame(capture->frames[0].path, {.metres_per_unit = 0.01, .up = "-y"});
  ASSERT_TRUE(frame.ok()) << frame.status();
  const auto estimated = EstimateNormals(frame->points.positions);
  ASSERT_TRUE(estimated.ok()) << estimated.status();
  std::size_t agree = 0;
  for (std::size_t i = 0; i < estimated->size(); ++i) agree += (*estimated)[i].dot(frame->points.normals[i]) > 0 ? 1 : 0;
  EXPECT_GT(static_cast<double>(agree), 0.9 * static_cast<double>(estimated->size()));
}

}  // namespace
}  // namespace vorocast::capture
