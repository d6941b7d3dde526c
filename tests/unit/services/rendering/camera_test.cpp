// SPDX-License-Identifier: AGPL-3.0-or-later
#include "services/rendering/camera.h"

#include <gtest/gtest.h>

#include <limits>
#include <numbers>

#include "services/base/random.h"

namespace vorocast::rendering {
namespace {

using geometry::Vec3f;

/// Pixels where a point appears.
Eigen::Vector2f Project(const Camera& camera, const Vec3f& point) {
  const Vec3f arm = point - camera.eye;
  const float depth = arm.dot(camera.forward);
  return {(arm.dot(camera.right) / depth - camera.left) / camera.pixel, (camera.top - arm.dot(camera.up) / depth) / camera.pixel};
}

Bounds RandomBody(std::uint64_t seed, const Vec3f& size) {
  base::Random random(seed);
  Bounds bounds;
  for (int i = 0; i < 5000; ++i) {
    bounds.centres.emplace_back(static_cast<float>(random.Uniform(-0.5, 0.5)) * size.x(), static_cast<float>(random.Uniform()) * size.y(),
                                static_cast<float>(random.Uniform(-0.5, 0.5)) * size.z());
    bounds.radii.push_back(0.02F);
  }
  return bounds;
}

TEST(FrameBounds, ShowsEverythingFromEverySideAndUpright) {
  for (double azimuth : {-120.0, 0.0, 25.0, 90.0, 300.0}) {
    for (const Vec3f& size : {Vec3f(0.5F, 1.8F, 0.3F), Vec3f(4, 0.5F, 1), Vec3f(0.1F, 3, 0.1F), Vec3f(1, 1, 1)}) {
      Bounds bounds = RandomBody(1, size);
      ASSERT_TRUE(Settle(bounds).ok());
      const Camera camera = FrameBounds(bounds, {.azimuth_deg = azimuth, .elevation_deg = 10, .width = 300});
      EXPECT_EQ(camera.width, 300);
      EXPECT_GE(camera.height, 149);
      EXPECT_LE(camera.height, 481);
      for (const Vec3f& c : bounds.centres) {
        const Eigen::Vector2f pixel = Project(camera, c);
        EXPECT_GT(pixel.x(), 0);
        EXPECT_LT(pixel.x(), static_cast<float>(camera.width));
        EXPECT_GT(pixel.y(), 0);
        EXPECT_LT(pixel.y(), static_cast<float>(camera.height));
      }
      // Up is up, and nothing is mirrored: seen from the front, +x is to the right.
      EXPECT_LT(Project(camera, {0, 1, 0}).y(), Project(camera, {0, 0, 0}).y());
      EXPECT_NEAR((camera.right.cross(camera.up) + camera.forward).norm(), 0, 1e-5);
      if (azimuth == 0) {
        EXPECT_GT(Project(camera, {0.1F, 0, 0}).x(), Project(camera, {-0.1F, 0, 0}).x());
      }
      const Ray ray = camera.Through(10, 20, 1);
      const Eigen::Vector2f back = Project(camera, camera.eye + 3 * ray.direction);
      EXPECT_NEAR(back.x(), 10, 0.05);
      EXPECT_NEAR(back.y(), 20, 0.05);
    }
  }
}

TEST(Settle, FramesThePerformerAndNotAFloorFullOfDebris) {
  const Bounds body = RandomBody(3, {0.5F, 1.8F, 0.3F});
  Bounds bounds = body;
  for (int i = 0; i < 400; ++i) {  // 4 m to both sides, half a metre below
    bounds.debris.emplace_back(-4.0F + 0.02F * static_cast<float>(i), -0.5F, 0.0F);
    bounds.debris_radii.push_back(0.01F);
  }
  ASSERT_TRUE(Settle(bounds).ok());
  EXPECT_NEAR(bounds.extent, 1.8, 0.02);
  EXPECT_FLOAT_EQ(bounds.ground, -0.51F);  // what lies near must lie on the ground, not under it
  ASSERT_FALSE(bounds.debris.empty());
  for (const Vec3f& c : bounds.debris) EXPECT_LT(std::abs(c.x()), 0.25 + 0.3 * 1.8 + 0.02);
  const Camera camera = FrameBounds(bounds, {.azimuth_deg = 0, .elevation_deg = 10, .width = 300});
  for (const Vec3f& c : bounds.debris) {
    const Eigen::Vector2f pixel = Project(camera, c);
    EXPECT_TRUE(pixel.x() > 0 && pixel.x() < 300 && pixel.y() > 0 && pixel.y() < static_cast<float>(camera.height)) << pixel;
  }
  // Where everything was let go, that is what there is to see.
  Bounds fallen{.debris = body.centres, .debris_radii = body.radii};
  ASSERT_TRUE(Settle(fallen).ok());
  EXPECT_NEAR(fallen.extent, 1.8, 0.02);
  EXPECT_FALSE(fallen.centres.empty());
}

TEST(Settle, LeavesStraysOutOfTheFrame) {
  Bounds bounds = RandomBody(2, {0.5F, 1.8F, 0.3F});
  bounds.centres.emplace_back(500.0F, -300.0F, 0.0F);
  bounds.radii.push_back(0.02F);
  bounds.companions = {{0.6F, 1, 0}, {40, 1, 0}};
  ASSERT_TRUE(Settle(bounds).ok());
  EXPECT_NEAR(bounds.extent, 1.8, 0.02);
  EXPECT_NEAR(bounds.ground, -0.02, 0.01);
  EXPECT_EQ(bounds.companions.size(), 1U);
  Bounds none;
  EXPECT_FALSE(Settle(none).ok());
  Bounds not_finite{.centres = {{0, std::numeric_limits<float>::quiet_NaN(), 0}}, .radii = {1}, .companions = {}};
  EXPECT_FALSE(Settle(not_finite).ok());
  Bounds single{.centres = {{1, 2, 3}}, .radii = {0.5F}, .companions = {}};
  ASSERT_TRUE(Settle(single).ok());
  EXPECT_EQ(single.ground, 1.5F);
}

/// A body with feet that stretch 0.25 m forward, turned about the vertical.
Bounds Person(float turn) {
  Bounds bounds = RandomBody(3, {0.5F, 1.8F, 0.2F});
  base::Random random(4);
  for (int i = 0; i < 300; ++i) {
    bounds.centres.emplace_back(static_cast<float>(random.Uniform(-0.2, 0.2)), static_cast<float>(random.Uniform(0, 0.05)),
                                static_cast<float>(random.Uniform(0, 0.25)));
    bounds.radii.push_back(0.02F);
  }
  const Eigen::AngleAxisf rotation(turn, Vec3f::UnitY());
  for (Vec3f& c : bounds.centres) c = rotation * c;
  return bounds;
}

TEST(ChooseAzimuth, LooksAtPeopleFromTheFront) {
  // Turning a body by 90 degrees turns the camera with it; 25 degrees off the front, rounded to steps of 15.
  for (int quarter = 0; quarter < 4; ++quarter) {
    const double azimuth = ChooseAzimuth({Person(static_cast<float>(quarter) * std::numbers::pi_v<float> / 2)});
    const double off = std::remainder(azimuth - 90.0 * quarter, 360.0);
    EXPECT_GE(off, 10) << quarter;
    EXPECT_LE(off, 40) << quarter;
    EXPECT_EQ(std::remainder(azimuth, 15.0), 0);
  }
  EXPECT_EQ(ChooseAzimuth({}), ChooseAzimuth({Bounds{}}));
}

}  // namespace
}  // namespace vorocast::rendering
