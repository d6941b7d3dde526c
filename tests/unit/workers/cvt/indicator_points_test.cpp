// SPDX-License-Identifier: AGPL-3.0-or-later
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <numbers>

#include "tests/unit/workers/cvt/indicator_scenes.h"
#include "workers/cvt/shells.h"
#include "workers/cvt/surface_from_points.h"

namespace vorocast::cvt {
namespace {

using geometry::OrientedPoints;
using geometry::Vec3;
using testing::HasSubstr;

OrientedPoints Sphere(const Vec3& centre, double radius, std::size_t count, double noise, std::uint64_t seed) {
  base::Random random(seed);
  OrientedPoints points;
  for (std::size_t p = 0; p < count; ++p) {
    const Vec3 n = Vec3(random.Gaussian(), random.Gaussian(), random.Gaussian()).normalized();
    points.positions.push_back(centre + (radius + noise * random.Gaussian()) * n);
    points.normals.push_back(n);
  }
  return points;
}

void Append(const OrientedPoints& more, OrientedPoints& points) {
  points.positions.insert(points.positions.end(), more.positions.begin(), more.positions.end());
  points.normals.insert(points.normals.end(), more.normals.begin(), more.normals.end());
}

OrientedPoints Only(const OrientedPoints& points, const std::function<bool(const Vec3&)>& keep) {
  OrientedPoints kept;
  for (std::size_t p = 0; p < points.size(); ++p) {
    if (!keep(points.positions[p])) continue;
    kept.positions.push_back(points.positions[p]);
    kept.normals.push_back(points.normals[p]);
  }
  return kept;
}

double BallVolume(double radius) { return 4.0 / 3 * std::numbers::pi * std::pow(radius, 3); }

std::string Error(const OrientedPoints& points, const IndicatorOptions& options = {}) {
  const auto surface = SurfaceFromPoints(points, options, nullptr);
  EXPECT_EQ(surface.status().code(), absl::StatusCode::kInvalidArgument);
  return std::string(surface.status().message());
}

TEST(SurfaceFromPoints, FindsASphereWithinItsNoise) {
  const Vec3 centre(0.3, 1, -2);
  for (IndicatorMethod method : {IndicatorMethod::kSpectral, IndicatorMethod::kCgal}) {
    IndicatorSummary summary;
    const auto surface = SurfaceFromPoints(Sphere(centre, 0.5, 20'000, 0.001, 1), {.method = method}, &summary);
    ASSERT_TRUE(surface.ok()) << surface.status();
    EXPECT_TRUE(geometry::IsClosed(surface->mesh));
    EXPECT_EQ(FindShells(surface->mesh).count, 1);
    EXPECT_NEAR(geometry::SignedVolume(surface->mesh), BallVolume(0.5), 0.01 * BallVolume(0.5));
    double mean = 0;
    for (const Vec3& x : surface->mesh.vertices) mean += std::abs((x - centre).norm() - 0.5) / static_cast<double>(surface->mesh.vertices.size());
    EXPECT_LT(mean, 0.0006);
    EXPECT_NEAR(summary.distance_mean_m, 0.0008, 0.0003);  // the noise's mean size
    EXPECT_EQ(summary.points_far, 0);
    EXPECT_GT(summary.spacing_m, 0);
  }
}

TEST(SurfaceFromPoints, SummarisesTheDistancesThatCgalMeasures) {
  const OrientedPoints points = Sphere(Vec3::Zero(), 0.5, 5'000, 0.004, 2);
  IndicatorSummary summary;
  const auto surface = SurfaceFromPoints(points, {}, &summary);
  ASSERT_TRUE(surface.ok()) << surface.status();
  EXPECT_NEAR(summary.distance_mean_m, scenes::Measure(points.positions, scenes::DistanceTo(surface->mesh)).mean, 1e-6);
}

TEST(SurfaceFromPoints, IsIndifferentToUnevenDensity) {
  base::Random random(5);
  const OrientedPoints thinned = Only(Sphere(Vec3::Zero(), 0.5, 40'000, 0, 3), [&](const Vec3& x) { return x[1] < 0 || random.Uniform() < 0.15; });
  const auto surface = SurfaceFromPoints(thinned, {}, nullptr);
  ASSERT_TRUE(surface.ok()) << surface.status();
  EXPECT_NEAR(geometry::SignedVolume(surface->mesh), BallVolume(0.5), 0.01 * BallVolume(0.5));
}

TEST(SurfaceFromPoints, ClosesAHole) {
  const OrientedPoints open = Only(Sphere(Vec3::Zero(), 0.5, 30'000, 0.001, 4), [](const Vec3& x) { return x[1] > -0.4; });
  const auto surface = SurfaceFromPoints(open, {}, nullptr);
  ASSERT_TRUE(surface.ok()) << surface.status();
  EXPECT_TRUE(geometry::IsClosed(surface->mesh));
  // The missing cap is 0.1 high: the lid lies somewhere between its base and a bulge beyond it.
  const double cap = std::numbers::pi * 0.01 * (3 * 0.5 - 0.1) / 3;
  EXPECT_GT(geometry::SignedVolume(surface->mesh), BallVolume(0.5) - 1.5 * cap);
  EXPECT_LT(geometry::SignedVolume(surface->mesh), BallVolume(0.5) + cap);
}

TEST(SurfaceFromPoints, KeepsCavitiesAndSeparateBodies) {
  OrientedPoints points = Sphere(Vec3::Zero(), 0.5, 30'000, 0, 6);
  OrientedPoints cavity = Sphere(Vec3::Zero(), 0.3, 12'000, 0, 7);
  for (Vec3& n : cavity.normals) n = -n;
  Append(cavity, points);
  Append(Sphere(Vec3(1.2, 0, 0), 0.2, 6'000, 0, 8), points);
  const auto surface = SurfaceFromPoints(points, {}, nullptr);
  ASSERT_TRUE(surface.ok()) << surface.status();
  EXPECT_EQ(FindShells(surface->mesh).count, 3);
  const double expected = BallVolume(0.5) - BallVolume(0.3) + BallVolume(0.2);
  EXPECT_NEAR(geometry::SignedVolume(surface->mesh), expected, 0.015 * expected);
}

TEST(SurfaceFromPoints, DropsSpecksAndCountsTheirPoints) {
  OrientedPoints points = Sphere(Vec3::Zero(), 0.5, 30'000, 0, 9);
  Append(Sphere(Vec3(0.8, 0, 0), 0.01, 40, 0, 10), points);
  IndicatorSummary summary;
  const auto surface = SurfaceFromPoints(points, {}, &summary);
  ASSERT_TRUE(surface.ok()) << surface.status();
  EXPECT_EQ(FindShells(surface->mesh).count, 1);
  EXPECT_EQ(summary.points_dropped_shells + summary.points_far, 40);
}

TEST(SurfaceFromPoints, IsDeterministic) {
  const OrientedPoints points = Sphere(Vec3::Zero(), 0.5, 8'000, 0.003, 11);
  const auto first = SurfaceFromPoints(points, {}, nullptr);
  const auto second = SurfaceFromPoints(points, {}, nullptr);
  ASSERT_TRUE(first.ok() && second.ok());
  EXPECT_EQ(first->mesh.triangles, second->mesh.triangles);
  EXPECT_EQ(first->mesh.vertices, second->mesh.vertices);
}

TEST(SurfaceFromPoints, StaysWithinTheGridLimit) {
  IndicatorSummary summary;
  const auto surface = SurfaceFromPoints(Sphere(Vec3::Zero(), 0.5, 8'000, 0, 12), {.spacing_m = 0.001, .grid_nodes_max = 200'000}, &summary);
  ASSERT_TRUE(surface.ok()) << surface.status();
  EXPECT_GT(summary.spacing_m, 0.015);
  EXPECT_NEAR(geometry::SignedVolume(surface->mesh), BallVolume(0.5), 0.02 * BallVolume(0.5));
}

TEST(SurfaceFromPoints, SaysWhyPointsBoundNoVolume) {
  const OrientedPoints sphere = Sphere(Vec3::Zero(), 0.5, 5'000, 0, 13);
  EXPECT_THAT(Error({}), HasSubstr("0 points"));
  EXPECT_THAT(Error(Only(sphere, [n = 0](const Vec3&) mutable { return n++ < 50; })), HasSubstr("at least 100"));

  OrientedPoints inverted = sphere;
  for (Vec3& n : inverted.normals) n = -n;
  EXPECT_THAT(Error(inverted), HasSubstr("normals point inward"));

  OrientedPoints not_finite = sphere;
  not_finite.positions[17][1] = std::numeric_limits<double>::quiet_NaN();
  not_finite.normals[18][0] = std::numeric_limits<double>::infinity();
  EXPECT_THAT(Error(not_finite), HasSubstr("2 of 5000 points or normals are not finite"));

  OrientedPoints without_normal = sphere;
  without_normal.normals[3] = Vec3::Zero();
  EXPECT_THAT(Error(without_normal), HasSubstr("1 of 5000 normals are not of unit length"));
  without_normal.normals.pop_back();
  EXPECT_THAT(Error(without_normal), HasSubstr("5000 points with 4999 normals"));

  OrientedPoints planar = sphere;
  for (Vec3& x : planar.positions) x[2] = 0.25;
  EXPECT_THAT(Error(planar), HasSubstr("plane"));
  OrientedPoints one_spot = sphere;
  for (Vec3& x : one_spot.positions) x = Vec3(1, 2, 3);
  EXPECT_THAT(Error(one_spot), HasSubstr("one spot"));

  EXPECT_THAT(Error(Only(sphere, [](const Vec3& x) { return x[0] > 0.2; })), HasSubstr("the surface is open"));
}

TEST(SurfaceFromPoints, RefusesNormalsThatAgreeOnNothing) {
  base::Random random(14);
  OrientedPoints points;
  for (int p = 0; p < 20'000; ++p) {
    points.positions.emplace_back(random.Uniform(), random.Uniform(), random.Uniform());
    points.normals.push_back(Vec3(random.Gaussian(), random.Gaussian(), random.Gaussian()).normalized());
  }
  // Whatever comes of a cloud without a surface, it is an error with a reason or a closed mesh.
  const auto surface = SurfaceFromPoints(points, {}, nullptr);
  const bool closed = surface.ok() && geometry::IsClosed(surface->mesh);
  EXPECT_TRUE(closed || surface.status().code() == absl::StatusCode::kInvalidArgument) << surface.status();
}

TEST(IndicatorOptions, AreChecked) {
  const OrientedPoints sphere = Sphere(Vec3::Zero(), 0.5, 500, 0, 15);
  EXPECT_THAT(Error(sphere, {.spacing_m = -1}), HasSubstr("spacing_m"));
  EXPECT_THAT(Error(sphere, {.spacing_m = std::numeric_limits<double>::quiet_NaN()}), HasSubstr("spacing_m"));
  EXPECT_THAT(Error(sphere, {.grid_nodes_max = 10}), HasSubstr("grid_nodes_max"));
  EXPECT_THAT(Error(sphere, {.smoothing_cells = -0.1}), HasSubstr("smoothing_cells"));
}

}  // namespace
}  // namespace vorocast::cvt
