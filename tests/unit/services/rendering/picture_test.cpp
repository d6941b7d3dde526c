// SPDX-License-Identifier: AGPL-3.0-or-later
#include "services/rendering/picture.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "tests/unit/services/rendering/sample_shapes.h"

namespace vorocast::rendering {
namespace {

using geometry::Rgb8;
using geometry::Vec3f;

constexpr float kFarBelow = -1e6F;
const Vec3f kRed(0.8F, 0.1F, 0.1F);
const Vec3f kBlue(0.1F, 0.1F, 0.8F);

/// From (0, 0, distance) along −z, symmetric window.
Camera FrontCamera(float distance, std::int32_t size, float half_window) {
  Camera camera;
  camera.eye = {0, 0, distance};
  camera.left = -half_window;
  camera.top = half_window;
  camera.pixel = 2 * half_window / static_cast<float>(size);
  camera.width = camera.height = size;
  return camera;
}

Triangles Ball(double radius, const Vec3f& centre, const Vec3f& colour) {
  const geometry::TriangleMesh mesh = testing::SphereMesh(radius, 60);
  Triangles triangles;
  for (const auto& t : mesh.triangles) {
    for (std::int32_t v : t) triangles.corners.push_back(mesh.vertices[static_cast<std::size_t>(v)].cast<float>() + centre);
    triangles.colours.push_back(colour);
  }
  return triangles;
}

Rgb8 PixelAt(const Image& image, std::int32_t column, std::int32_t row) {
  const std::size_t at = 3 * static_cast<std::size_t>(row * image.width + column);
  return {image.rgb[at], image.rgb[at + 1], image.rgb[at + 2]};
}

std::int64_t CountDrawn(const Image& image) {
  std::int64_t drawn = 0;
  for (std::int32_t row = 0; row < image.height; ++row) {
    for (std::int32_t column = 0; column < image.width; ++column) drawn += PixelAt(image, column, row) != Backdrop(row, image.height) ? 1 : 0;
  }
  return drawn;
}

Image Render(const std::vector<Disc>& discs, const std::vector<Triangles>& meshes, const Camera& camera, float ground = kFarBelow) {
  auto scene = Scene::Build(discs, meshes);
  EXPECT_TRUE(scene.ok()) << scene.status();
  return RenderPicture(*scene, camera, {.ground = ground, .extent = 1}, {});
}

TEST(RenderPicture, NothingButBackdropWhereNothingIs) {
  const Camera camera = FrontCamera(4, 60, 0.5F);
  EXPECT_EQ(CountDrawn(Render({}, {}, camera)), 0);
  EXPECT_EQ(CountDrawn(Render({}, {}, camera, -1)), 0);  // an empty ground shows nothing either
  const Image image = Render({}, {}, camera);
  EXPECT_EQ(image.rgb.size(), 3U * 60 * 60);
}

// A sphere of radius r at distance d is seen as a disc of radius r / sqrt(d² − r²) on the plane at distance 1.
TEST(RenderPicture, ASphereCoversTheAreaOfItsProjection) {
  for (float radius : {0.3F, 0.8F}) {
    const Camera camera = FrontCamera(4, 200, 0.25F);
    const auto drawn = static_cast<double>(CountDrawn(Render({}, {Ball(static_cast<double>(radius), Vec3f::Zero(), kRed)}, camera)));
    const double pixels = static_cast<double>(radius / std::sqrt(16 - radius * radius) / camera.pixel);
    const double area = std::numbers::pi * pixels * pixels;
    const double rim = 2 * std::numbers::pi * pixels;  // a pixel that the rim crosses counts as drawn
    EXPECT_GT(drawn, area - 0.02 * area);
    EXPECT_LT(drawn, area + rim);
  }
}

TEST(RenderPicture, ADiscCoversTheAreaOfItsProjectionAndIsDullFromBehind) {
  const Camera camera = FrontCamera(4, 200, 0.25F);
  const Disc front{.centre = Vec3f::Zero(), .normal = {0, 0, 1}, .radius = 0.5F, .colour = kRed};
  const Image image = Render({front}, {}, camera);
  const double pixels = static_cast<double>(0.5F / 4 / camera.pixel);
  const auto drawn = static_cast<double>(CountDrawn(image));
  EXPECT_GT(drawn, std::numbers::pi * pixels * pixels * 0.99);
  EXPECT_LT(drawn, std::numbers::pi * pixels * (pixels + 2));
  Disc turned = front;
  turned.normal = {0, 0, -1};
  EXPECT_LT(PixelAt(Render({turned}, {}, camera), 100, 100)[0], PixelAt(image, 100, 100)[0] * 3 / 4);
}

TEST(RenderPicture, TheNearerHidesTheFarther) {
  const Camera camera = FrontCamera(6, 80, 0.2F);
  const auto is_red = [](const Rgb8& c) { return c[0] > c[2]; };
  const Vec3f near_place(0, 0, 1);
  const Vec3f far_place(0, 0, -1);
  EXPECT_TRUE(is_red(PixelAt(Render({}, {Ball(0.5, near_place, kRed), Ball(0.5, far_place, kBlue)}, camera), 40, 40)));
  EXPECT_FALSE(is_red(PixelAt(Render({}, {Ball(0.5, near_place, kBlue), Ball(0.5, far_place, kRed)}, camera), 40, 40)));
  const Disc disc{.centre = {0, 0, 2}, .normal = {0, 0, 1}, .radius = 0.2F, .colour = kBlue};
  EXPECT_FALSE(is_red(PixelAt(Render({disc}, {Ball(0.5, near_place, kRed)}, camera), 40, 40)));
}

TEST(RenderPicture, CastsAShadowOnTheGroundOnly) {
  Camera camera = FrontCamera(5, 120, 0.3F);
  camera.eye.y() = 0.5F;
  const std::vector<Triangles> ball = {Ball(0.4, Vec3f::Zero(), kRed)};
  const Image floating = Render({}, ball, camera);
  const Image standing = Render({}, ball, camera, -0.4F);
  std::int64_t darker = 0;
  for (std::size_t i = 0; i < floating.rgb.size(); i += 3) {
    EXPECT_LE(standing.rgb[i], floating.rgb[i] + 1);
    darker += standing.rgb[i] + 20 < floating.rgb[i] ? 1 : 0;
  }
  EXPECT_GT(darker, 100);
  // Above the horizon nothing changes.
  for (std::size_t i = 0; i < 3U * 120 * 40; ++i) ASSERT_EQ(standing.rgb[i], floating.rgb[i]);
}

TEST(RenderPicture, GivesTheSameBytesTwiceAndReportsProgress) {
  auto scene = Scene::Build({}, {Ball(0.4, Vec3f::Zero(), kRed)});
  ASSERT_TRUE(scene.ok());
  const Camera camera = FrontCamera(4, 50, 0.2F);
  std::vector<double> reported;
  const Image first = RenderPicture(*scene, camera, {.ground = -0.4F, .extent = 1}, [&](double fraction) { reported.push_back(fraction); });
  EXPECT_EQ(first.rgb, Render({}, {Ball(0.4, Vec3f::Zero(), kRed)}, camera, -0.4F).rgb);
  ASSERT_EQ(reported.size(), 50U);
  EXPECT_TRUE(std::ranges::is_sorted(reported));
  EXPECT_EQ(reported.back(), 1);
}

}  // namespace
}  // namespace vorocast::rendering
