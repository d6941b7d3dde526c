// SPDX-License-Identifier: AGPL-3.0-or-later
#include "services/rendering/film_camera.h"

#include <cmath>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

namespace vorocast::rendering {
namespace {

using geometry::Vec3f;
using nlohmann::json;
using ::testing::HasSubstr;

/// Pixels from the picture's top left corner, by the rule that Camera::Through states.
Eigen::Vector2f Project(const Camera& camera, const Vec3f& x) {
  const Vec3f arm = x - camera.eye;
  const float depth = arm.dot(camera.forward);
  return {(arm.dot(camera.right) / depth - camera.left) / camera.pixel, (camera.top - arm.dot(camera.up) / depth) / camera.pixel};
}

TEST(CameraPath, TheTargetIsInTheMiddleAndTheFieldOfViewFillsTheHeight) {
  const CameraPath path = CameraPathFromJson(json::parse(R"({"eye_m": [1, 2, 5], "target_m": [1, 2, 1], "fov_deg": 90})")).value();
  const Camera camera = CameraAt(path, 0, 200, 100);
  EXPECT_LT((Project(camera, {1, 2, 1}) - Eigen::Vector2f(100, 50)).norm(), 1e-3);
  // 45° up at a distance of four is four higher: the picture's upper edge.
  EXPECT_LT((Project(camera, {1, 6, 1}) - Eigen::Vector2f(100, 0)).norm(), 1e-3);
  EXPECT_LT((Project(camera, {5, 2, 1}) - Eigen::Vector2f(150, 50)).norm(), 1e-3);
}

TEST(CameraPath, GoesStraightFromKeyToKey) {
  const CameraPath path = CameraPathFromJson(json::parse(R"({"keys": [{"time_s": 1, "eye_m": [0, 1, 4], "target_m": [0, 1, 0], "fov_deg": 20},
                                                  {"time_s": 3, "eye_m": [4, 1, 4], "target_m": [0, 3, 0], "fov_deg": 40}]})"))
                              .value();
  EXPECT_EQ(CameraAt(path, 0, 100, 100).eye, Vec3f(0, 1, 4));
  EXPECT_EQ(CameraAt(path, 9, 100, 100).eye, Vec3f(4, 1, 4));
  const Camera middle = CameraAt(path, 2, 100, 100);
  EXPECT_LT((middle.eye - Vec3f(2, 1, 4)).norm(), 1e-6);
  EXPECT_LT((Project(middle, {0, 2, 0}) - Eigen::Vector2f(50, 50)).norm(), 1e-3);
  EXPECT_NEAR(middle.pixel * 100, 2 * std::tan(15 * M_PI / 180), 1e-6);
}

TEST(CameraPath, SaysWhatIsWrong) {
  const auto message = [](const char* text) { return std::string(CameraPathFromJson(json::parse(text)).status().message()); };
  EXPECT_THAT(message(R"([1, 2])"), HasSubstr("give an object"));
  EXPECT_THAT(message(R"({"eye_m": [0, 1], "target_m": [0, 0, 0]})"), HasSubstr("eye_m: give three numbers"));
  EXPECT_THAT(message(R"({"eye_m": [0, 1, "a"], "target_m": [0, 0, 0]})"), HasSubstr("the third number"));
  EXPECT_THAT(message(R"({"eye_m": [0, 1, 1], "target_m": [0, 1, 1]})"), HasSubstr("where the eye is"));
  EXPECT_THAT(message(R"({"eye_m": [0, 1, 1], "target_m": [0, 9, 1]})"), HasSubstr("straight above"));
  EXPECT_THAT(message(R"({"eye_m": [0, 1, 1], "target_m": [0, 1, 0], "fov_deg": 200})"), HasSubstr("fov_deg: give a number from 1 to 150"));
  EXPECT_THAT(message(R"({"eye_m": [0, 1, 1], "target_m": [0, 1, 0], "zoom": 2})"), HasSubstr("zoom: unknown"));
  EXPECT_THAT(message(R"({"keys": []})"), HasSubstr("give 1 to"));
  EXPECT_THAT(
      message(R"({"keys": [{"time_s": 1, "eye_m": [0, 1, 1], "target_m": [0, 1, 0]}, {"time_s": 1, "eye_m": [0, 1, 1], "target_m": [0, 1, 0]}]})"),
      HasSubstr("order the keys"));
}

TEST(CameraForFilm, ShowsAllOfTheBoundsWhateverThePicturesShape) {
  Bounds bounds;
  bounds.centres = {{-0.5F, 0, 0.2F}, {0.5F, 0, -0.2F}, {0, 1.8F, 0}};
  bounds.radii = {0.05F, 0.05F, 0.05F};
  bounds.extent = 1.9F;
  for (const auto& [width, height] : {std::pair{1920, 1080}, {400, 1000}}) {
    const Camera camera = CameraForFilm(bounds, 25, width, height);
    EXPECT_EQ(camera.width, width);
    EXPECT_EQ(camera.height, height);
    for (const Vec3f& centre : bounds.centres) {
      const Eigen::Vector2f at = Project(camera, centre);
      EXPECT_GT(at.x(), 0.02F * static_cast<float>(width));
      EXPECT_LT(at.x(), 0.98F * static_cast<float>(width));
      EXPECT_GT(at.y(), 0.02F * static_cast<float>(height));
      EXPECT_LT(at.y(), 0.98F * static_cast<float>(height));
    }
  }
}

}  // namespace
}  // namespace vorocast::rendering
