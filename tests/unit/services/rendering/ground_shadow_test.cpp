// SPDX-License-Identifier: AGPL-3.0-or-later
#include "services/rendering/ground_shadow.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

namespace vorocast::rendering {
namespace {

using geometry::Vec3f;

/// A square plate, two triangles, level with the ground.
Triangles Plate(const Vec3f& middle, float half) {
  const Vec3f a = middle + Vec3f(-half, 0, -half), b = middle + Vec3f(-half, 0, half), c = middle + Vec3f(half, 0, half),
              d = middle + Vec3f(half, 0, -half);
  Triangles triangles;
  triangles.corners = {a, b, c, a, c, d};
  triangles.colours.assign(2, Vec3f::Ones());
  return triangles;
}

/// From two metres up, a plate of 0.8 m at `height` over the ground throws its shadow to the right of and behind what is below it.
struct Stage {
  Camera camera;
  Studio studio{.ground = 0, .extent = 1};
  Scene scene;
  StudioLight light;

  explicit Stage(float height)
      : camera(LookingDown()), scene(Scene::Build({}, {Plate({0, height, 0}, 0.4F)}).value()), light(scene, camera, studio, {}) {}

  static Camera LookingDown() {
    Camera camera;
    camera.eye = {0, 2, 2};
    camera.forward = Vec3f(0, -1, -1).normalized();
    camera.up = Vec3f(0, 1, -1).normalized();
    camera.width = camera.height = 160;
    camera.pixel = 0.01F;
    camera.left = -0.8F;
    camera.top = 0.8F;
    return camera;
  }
};

// A plate beyond the reach of the sky's shadows takes away the key light and nothing else: what is left is the sky's share of the light, which
// follows from the colours and heights in studio.cpp. The mean of the height over a cosine-weighted hemisphere is 2/3.
TEST(GroundShadow, IsTheShareOfTheLightThatIsBlocked) {
  Stage stage(0.5F);
  GroundShadow shadow(stage.light, stage.camera, false, 16);
  float darkest = 1;
  float brightest = 0;
  for (std::int32_t row = 0; row < stage.camera.height; ++row) {
    for (std::int32_t column = 0; column < stage.camera.width; ++column) {
      const float green = shadow.At(column, row).y();
      darkest = std::min(darkest, green);
      brightest = std::max(brightest, green);
    }
  }
  const float sky = 0.70F * (0.85F + 0.3F * 2 / 3);
  const float key = 1.15F * std::sin(0.85F);
  EXPECT_NEAR(darkest, sky / (sky + key), 0.01);
  EXPECT_EQ(brightest, 1);
}

// What is interpolated between corners is what many rays say, and has no grain: along a row, a penumbra climbs or falls, but does not waver.
TEST(GroundShadow, IsSmooth) {
  Stage stage(0.2F);
  GroundShadow coarse(stage.light, stage.camera, false, 4);
  GroundShadow fine(stage.light, stage.camera, false, 16);
  double squares = 0;
  for (std::int32_t row = 0; row < stage.camera.height; ++row) {
    for (std::int32_t column = 0; column < stage.camera.width; ++column) {
      squares += (coarse.At(column, row) - fine.At(column, row)).squaredNorm() / 3;
    }
  }
  EXPECT_LT(std::sqrt(squares / (stage.camera.width * stage.camera.height)), 0.012);
}

TEST(GroundShadow, DoesNotDependOnTheOrderOfQuestions) {
  Stage stage(0.2F);
  GroundShadow forwards(stage.light, stage.camera, true, 4);
  GroundShadow backwards(stage.light, stage.camera, true, 4);
  const std::int32_t last = stage.camera.width - 1;
  for (std::int32_t i = 0; i <= last; ++i) (void)forwards.At(i, 90);
  for (std::int32_t i = last; i >= 0; --i) EXPECT_EQ(backwards.At(i, 90), forwards.At(i, 90)) << i;
}

}  // namespace
}  // namespace vorocast::rendering
