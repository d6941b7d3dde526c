// SPDX-License-Identifier: AGPL-3.0-or-later
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "services/base/random.h"
#include "workers/cvt/point_areas.h"
#include "workers/cvt/sorted_points.h"
#include "workers/cvt/spectral_poisson.h"

namespace vorocast::cvt {
namespace {

using geometry::OrientedPoints;
using geometry::Vec3;

/// Points on a sphere about the origin; `thinning` is the share of the points kept on the half with x > 0.
OrientedPoints Sphere(double radius, std::size_t count, double thinning, std::uint64_t seed) {
  base::Random random(seed);
  OrientedPoints points;
  while (points.size() < count) {
    const Vec3 n = Vec3(random.Gaussian(), random.Gaussian(), random.Gaussian()).normalized();
    if (n[0] > 0 && random.Uniform() > thinning) continue;
    points.positions.push_back(radius * n);
    points.normals.push_back(n);
  }
  return points;
}

GridFrame FrameAround(double half_extent, double spacing) {
  return FitGrid(geometry::Box3(Vec3::Constant(-half_extent), Vec3::Constant(half_extent)), spacing, 6 * spacing, 8'000'000);
}

TEST(FitGrid, CoversTheBoxWithFastSizesWithinTheLimit) {
  const geometry::Box3 box(Vec3(-0.3, 0.1, 5), Vec3(0.4, 1.9, 5.5));
  for (std::int64_t limit : {40'000, 300'000, 8'000'000}) {
    const GridFrame frame = FitGrid(box, 0.01, 0.05, limit);
    EXPECT_LE(static_cast<std::int64_t>(frame.size()), limit);
    EXPECT_GE(frame.spacing, 0.01);
    for (int a = 0; a < 3; ++a) {
      std::int32_t rest = frame.nodes[static_cast<std::size_t>(a)];
      EXPECT_LE(frame.origin[a], box.min()[a] - 0.05 + 1e-9);
      EXPECT_GE(frame.origin[a] + frame.spacing * (rest - 1), box.max()[a] + 0.05 - 1e-9);
      for (std::int32_t prime : {2, 3, 5, 7}) {
        while (rest % prime == 0) rest /= prime;
      }
      EXPECT_EQ(rest, 1);
    }
  }
  EXPECT_DOUBLE_EQ(FitGrid(box, 0.01, 0.05, 8'000'000).spacing, 0.01);
}

TEST(MeanPointSpacing, IsTheRootOfTheAreaOfOnePoint) {
  const OrientedPoints points = Sphere(1, 20'000, 1, 5);
  EXPECT_NEAR(MeanPointSpacing(points), std::sqrt(4 * std::numbers::pi / 20'000), 0.15 * std::sqrt(4 * std::numbers::pi / 20'000));
}

TEST(EstimateAreas, GivesTheAreaOfAnEvenAndOfAnUnevenScan) {
  for (double thinning : {1.0, 0.25}) {
    const OrientedPoints points = Sphere(1, 20'000, thinning, 7);
    const GridFrame frame = FrameAround(1, 0.03);
    SortedPoints sorted(points, frame, 2);
    EstimateAreas(frame, static_cast<float>(MeanPointSpacing(points) / frame.spacing), sorted);
    std::array<double, 2> area{};  // of the halves x < 0 and x > 0
    for (const GridPoint& p : sorted.points()) area[p.normal[0] > 0 ? 1 : 0] += static_cast<double>(p.area) * frame.spacing * frame.spacing;
    // A point counts itself too, which takes some area off where points are few.
    EXPECT_NEAR(area[0], 2 * std::numbers::pi, 0.06 * 2 * std::numbers::pi);
    EXPECT_NEAR(area[1], 2 * std::numbers::pi, 0.15 * 2 * std::numbers::pi);
  }
}

TEST(EstimateAreas, KeepsTheSidesOfAThinSheetApart) {
  base::Random random(3);
  OrientedPoints points;
  for (int p = 0; p < 20'000; ++p) {
    const double side = p % 2 == 0 ? 1 : -1;
    points.positions.emplace_back(random.Uniform(), random.Uniform(), 0.002 * side);
    points.normals.emplace_back(0, 0, side);
  }
  const GridFrame frame = FitGrid(geometry::Box3(Vec3(0, 0, -0.01), Vec3(1, 1, 0.01)), 0.01, 0.06, 8'000'000);
  SortedPoints sorted(points, frame, 2);
  EstimateAreas(frame, 1, sorted);
  double inner_area = 0;  // away from the rim, where half of the neighbours are missing
  for (const GridPoint& p : sorted.points()) {
    const Vec3 x = frame.ToWorld(p.u);
    if (x[0] > 0.1 && x[0] < 0.9 && x[1] > 0.1 && x[1] < 0.9) inner_area += static_cast<double>(p.area) * 1e-4;
  }
  EXPECT_NEAR(inner_area, 2 * 0.8 * 0.8, 0.08 * 2 * 0.8 * 0.8);
}

TEST(SortedPoints, VisitsEveryPointOfABall) {
  const OrientedPoints points = Sphere(1, 3'000, 1, 9);
  const GridFrame frame = FrameAround(1, 0.05);
  const SortedPoints sorted(points, frame, 1.7F);
  ASSERT_EQ(sorted.points().size(), points.size());
  for (const Vec3& centre : {Vec3(1, 0, 0), Vec3(0.5, 0.5, 0.7), Vec3(0, 0, 0)}) {
    const geometry::Vec3f u = frame.ToGrid(centre);
    const float radius = 4.3F;
    std::size_t found = 0;
    sorted.ForEachNear(u, radius, [&](const GridPoint& p) { found += (p.u - u).norm() < radius ? 1 : 0; });
    const auto expected = std::ranges::count_if(points.positions, [&](const Vec3& x) { return (frame.ToGrid(x) - u).norm() < radius; });
    EXPECT_EQ(found, static_cast<std::size_t>(expected));
  }
}

TEST(SolveSpectralPoisson, StepsByOneAcrossASphere) {
  const OrientedPoints points = Sphere(1, 30'000, 1, 11);
  const GridFrame frame = FrameAround(1, 0.04);
  SortedPoints sorted(points, frame, 2);
  for (GridPoint& p : sorted.points()) p.area = static_cast<float>(4 * std::numbers::pi / 30'000 / (frame.spacing * frame.spacing));
  const ScalarGrid indicator = SolveSpectralPoisson(frame, sorted, 0.6);
  const float centre = Interpolate(indicator, frame.ToGrid(Vec3::Zero()));
  // Outside the field is constant, up to the sampling noise of the points; half-way lies on the sphere.
  for (const Vec3& n : {Vec3(1, 0, 0), Vec3(0, -1, 0), Vec3(0.6, 0.8, 0), Vec3(0.48, 0.6, -0.64)}) {
    const float outside = Interpolate(indicator, frame.ToGrid(1.15 * n));
    EXPECT_NEAR(centre - outside, 1, 0.03);
    EXPECT_NEAR(centre - Interpolate(indicator, frame.ToGrid(n)), 0.5, 0.12);
    EXPECT_NEAR(centre - Interpolate(indicator, frame.ToGrid(0.85 * n)), 0, 0.03);
  }
}

}  // namespace
}  // namespace vorocast::cvt
