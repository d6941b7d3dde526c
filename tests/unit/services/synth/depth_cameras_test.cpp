// SPDX-License-Identifier: AGPL-3.0-or-later
#include "services/synth/depth_cameras.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <set>
#include <tuple>

#include "services/synth/implicit_surface.h"
#include "tests/unit/services/synth/closest_point.h"

namespace vorocast::synth {
namespace {

using geometry::Vec3;

geometry::TriangleMesh Sphere(const Vec3& centre, double radius) {
  ImplicitSurface surface(0.01, 0.01);
  surface.Add({.from = centre, .to = centre, .from_radius = radius, .to_radius = radius});
  return ExtractSurface(surface, radius / 20);
}

geometry::TriangleMesh Both(const geometry::TriangleMesh& a, const geometry::TriangleMesh& b) {
  geometry::TriangleMesh both = a;
  both.vertices.insert(both.vertices.end(), b.vertices.begin(), b.vertices.end());
  const auto first = static_cast<std::int32_t>(a.vertices.size());
  for (const auto& t : b.triangles) both.triangles.push_back({t[0] + first, t[1] + first, t[2] + first});
  return both;
}

geometry::Box3 BoxOf(const geometry::TriangleMesh& mesh) {
  geometry::Box3 box;
  for (const Vec3& x : mesh.vertices) box.extend(x);
  return box;
}

geometry::OrientedPoints ScanOnce(const geometry::TriangleMesh& mesh, const ScanOptions& options, std::int32_t frame = 0) {
  DepthScanner scanner(mesh, BoxOf(mesh), options);
  scanner.Calibrate(mesh.vertices);
  return scanner.Scan(mesh.vertices, frame);
}

TEST(RingOfCameras, SurroundsTheSubjectAndLooksAtIt) {
  const geometry::Box3 subject(Vec3(-0.5, 0, -0.3), Vec3(0.7, 1.8, 0.3));
  const std::vector<DepthCamera> cameras = RingOfCameras(subject, 12);
  ASSERT_EQ(cameras.size(), 12u);
  Vec3 mean = Vec3::Zero();
  for (const DepthCamera& camera : cameras) {
    EXPECT_FALSE(subject.contains(camera.position));
    EXPECT_GT(camera.position.y(), 0.1);  // above the floor
    EXPECT_LT(camera.forward.cross(subject.center() - camera.position).norm(), 1e-9);
    EXPECT_NEAR(camera.right.cross(camera.up).dot(camera.forward), -1, 1e-9);
    mean += camera.position / 12;
  }
  EXPECT_NEAR(mean.x(), subject.center().x(), 1e-9);
  EXPECT_NEAR(mean.z(), subject.center().z(), 1e-9);
}

TEST(DepthScanner, WithoutNoisePointsLieOnTheSurfaceWithItsNormals) {
  const geometry::TriangleMesh ball = Sphere({0.1, 1, 0}, 0.4);
  const geometry::OrientedPoints points = ScanOnce(ball, {.points = 8000, .noise_m = 0, .flying_fraction = 0, .normal_noise_degrees = 0});
  EXPECT_LE(points.size(), 8000u);
  EXPECT_GE(points.size(), 7600u);
  const ClosestPoint surface(ball);
  for (std::size_t i = 0; i < points.size(); ++i) {
    ASSERT_LT(surface.Distance(points.positions[i]), 1e-9);
    ASSERT_GT(points.normals[i].dot((points.positions[i] - Vec3(0.1, 1, 0)).normalized()), 0.999);
    ASSERT_NEAR(points.normals[i].norm(), 1, 1e-12);
  }
}

TEST(DepthScanner, SeesEverySideOfABallButNothingInsideIt) {
  const geometry::TriangleMesh nested = Both(Sphere({0, 1, 0}, 0.4), Sphere({0, 1, 0}, 0.3));
  const geometry::OrientedPoints points = ScanOnce(nested, {.points = 8000, .flying_fraction = 0});
  std::array<int, 8> octant{};
  for (const Vec3& x : points.positions) {
    const Vec3 local = x - Vec3(0, 1, 0);
    EXPECT_GT(local.norm(), 0.38);
    ++octant[static_cast<std::size_t>((local.x() > 0) + 2 * (local.y() > 0) + 4 * (local.z() > 0))];
  }
  for (int count : octant) EXPECT_GT(count, 300);

  DepthScanner scanner(nested, BoxOf(nested), {});
  const std::vector<char> seen = scanner.Seen(nested.vertices);
  for (std::size_t v = 0; v < seen.size(); ++v) {
    const Vec3 local = nested.vertices[v] - Vec3(0, 1, 0);
    EXPECT_FALSE(local.norm() < 0.35 && seen[v]);
    EXPECT_TRUE(local.norm() < 0.35 || std::abs(local.y()) > 0.2 || seen[v]);
  }
}

TEST(DepthScanner, NoiseHasTheSizeAskedForAndNormalsTheTilt) {
  const geometry::TriangleMesh ball = Sphere({0, 1, 0}, 0.4);
  const geometry::OrientedPoints points = ScanOnce(ball, {.points = 20'000, .noise_m = 0.003, .flying_fraction = 0, .normal_noise_degrees = 5});
  double across2 = 0, tilt2 = 0;
  for (std::size_t i = 0; i < points.size(); ++i) {
    const Vec3 local = points.positions[i] - Vec3(0, 1, 0);
    across2 += std::pow(local.norm() - 0.4, 2);
    tilt2 += std::pow(std::acos(std::clamp(points.normals[i].dot(local.normalized()), -1.0, 1.0)), 2);
  }
  // Along the ray the error is noise (1 + (1/c − 1)/2), c being the cosine; across the surface that times c: noise (1 + c)/2, for c from 0.2 up.
  const double noise = std::sqrt(across2 / static_cast<double>(points.size()));
  EXPECT_GT(noise, 0.6 * 0.003);
  EXPECT_LT(noise, 1.0 * 0.003);
  const double tilt = std::sqrt(tilt2 / static_cast<double>(points.size())) * 180 / std::numbers::pi;
  EXPECT_NEAR(tilt, 5 * std::sqrt(2.0), 0.35);  // two axes, and the ball's facets add a little
}

TEST(DepthScanner, FlyingPixelsAreAsManyAsAskedFor) {
  const geometry::TriangleMesh pair = Both(Sphere({-0.5, 1, 0}, 0.15), Sphere({0.5, 1, 0}, 0.15));
  const geometry::OrientedPoints points = ScanOnce(pair, {.points = 20'000, .noise_m = 0, .flying_fraction = 0.02});
  const ClosestPoint surface(pair);
  const auto off = std::ranges::count_if(points.positions, [&](const Vec3& x) { return surface.Distance(x) > 1e-6; });
  EXPECT_NEAR(static_cast<double>(off) / static_cast<double>(points.size()), 0.02, 0.006);
}

TEST(DepthScanner, RepeatsItselfForAFrameAndSharesNothingBetweenFrames) {
  const geometry::TriangleMesh ball = Sphere({0, 1, 0}, 0.4);
  const ScanOptions options{.points = 5000, .noise_m = 0, .flying_fraction = 0};
  const geometry::OrientedPoints once = ScanOnce(ball, options, 3), again = ScanOnce(ball, options, 3), next = ScanOnce(ball, options, 4);
  EXPECT_EQ(once.positions, again.positions);
  EXPECT_EQ(once.normals, again.normals);
  std::set<std::tuple<double, double, double>> seen;
  for (const Vec3& x : once.positions) seen.emplace(x.x(), x.y(), x.z());
  for (const Vec3& x : next.positions) EXPECT_FALSE(seen.contains({x.x(), x.y(), x.z()}));
}

}  // namespace
}  // namespace vorocast::synth
