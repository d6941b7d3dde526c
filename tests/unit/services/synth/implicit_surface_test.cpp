// SPDX-License-Identifier: AGPL-3.0-or-later
#include "services/synth/implicit_surface.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <numbers>

#include "services/base/random.h"

namespace vorocast::synth {
namespace {

using geometry::Vec3;

TEST(Blob, DistanceIsThatOfTheBallsSweptAlongIt) {
  const Blob blob{.from = {0.1, 0.2, -0.1}, .to = {0.3, 0.1, 0.2}, .from_radius = 0.08, .to_radius = 0.05};
  base::Random random(3);
  for (int i = 0; i < 200; ++i) {
    const Vec3 x(random.Uniform(-0.5, 0.8), random.Uniform(-0.5, 0.8), random.Uniform(-0.5, 0.8));
    double nearest = 1e9;  // over very many of the balls
    for (int k = 0; k <= 20'000; ++k) {
      const double s = k / 20'000.0;
      nearest = std::min(nearest, (x - blob.from - s * (blob.to - blob.from)).norm() - (0.08 + s * (0.05 - 0.08)));
    }
    EXPECT_NEAR(blob.Distance(x), nearest, 1e-7) << x.transpose();
  }
}

TEST(Blob, AStretchedBallIsAnEllipsoidAndItsDistanceIsRightNearTheSurface) {
  const Blob blob{.from = Vec3::Zero(), .to = Vec3::Zero(), .from_radius = 0.2, .to_radius = 0.2, .stretch = {1, 0.5, 0.25}};
  EXPECT_NEAR(blob.Distance({0.2, 0, 0}), 0, 1e-12);
  EXPECT_NEAR(blob.Distance({0, 0.1, 0}), 0, 1e-12);
  EXPECT_NEAR(blob.Distance({0, 0.102, 0}), 0.002, 1e-12);
  EXPECT_NEAR(blob.Distance({0, 0, -0.055}), 0.005, 1e-12);
}

TEST(ExtractSurface, ASphereHasItsRadiusAreaAndVolume) {
  ImplicitSurface surface(0.02, 0.02);
  const Vec3 centre(0.3, -0.1, 0.05);
  surface.Add({.from = centre, .to = centre, .from_radius = 0.1, .to_radius = 0.1});
  const geometry::TriangleMesh mesh = ExtractSurface(surface, 0.008);
  ASSERT_TRUE(geometry::IsClosed(mesh));
  for (const Vec3& x : mesh.vertices) EXPECT_NEAR((x - centre).norm(), 0.1, 1e-5);
  EXPECT_NEAR(geometry::SignedVolume(mesh), 4.0 / 3 * std::numbers::pi * 1e-3, 0.01 * 4.2e-3);
  EXPECT_NEAR(geometry::SurfaceArea(mesh), 4 * std::numbers::pi * 1e-2, 0.01 * 0.126);
}

TEST(ExtractSurface, LimbsMeltTogetherAndChainsDoNotSwell) {
  // Two halves of one straight rod: as one limb with a narrow seam the radius in the middle stays nearly that of the rod.
  ImplicitSurface rod(0.04, 0.004);
  rod.Add({.from = {0, 0, 0}, .to = {0, 0.2, 0}, .from_radius = 0.03, .to_radius = 0.03, .limb = 0});
  rod.Add({.from = {0, 0.2, 0}, .to = {0, 0.4, 0}, .from_radius = 0.03, .to_radius = 0.03, .limb = 0});
  EXPECT_NEAR(rod({0.03, 0.2, 0}), 0, 0.0011);
  // Two apart by less than the blend become one body.
  ImplicitSurface pair(0.04, 0.004);
  pair.Add({.from = {-0.06, 0, 0}, .to = {-0.06, 0, 0}, .from_radius = 0.055, .to_radius = 0.055});
  pair.Add({.from = {0.06, 0, 0}, .to = {0.06, 0, 0}, .from_radius = 0.055, .to_radius = 0.055});
  EXPECT_LT(pair(Vec3::Zero()), 0);
  EXPECT_TRUE(geometry::IsClosed(ExtractSurface(pair, 0.006)));
}

TEST(ExtractSurface, IsCutFlatAtTheFloor) {
  ImplicitSurface surface(0.02, 0.02, 0.0);
  surface.Add({.from = {0, 0.02, 0}, .to = {0, 0.02, 0}, .from_radius = 0.05, .to_radius = 0.05});
  const geometry::TriangleMesh mesh = ExtractSurface(surface, 0.006);
  EXPECT_TRUE(geometry::IsClosed(mesh));
  for (const Vec3& x : mesh.vertices) EXPECT_GT(x.y(), -0.002);
}

}  // namespace
}  // namespace vorocast::synth
