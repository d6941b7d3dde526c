// SPDX-License-Identifier: AGPL-3.0-or-later
#include <gtest/gtest.h>

#include "tests/unit/workers/cvt/indicator_scenes.h"
#include "workers/cvt/self_intersection.h"
#include "workers/cvt/surface_from_mesh.h"
#include "workers/cvt/surface_from_points.h"

namespace vorocast::cvt {
namespace {

using geometry::OrientedPoints;
using geometry::Vec3;

#define SKIP_WITHOUT(capture) \
  if (!(capture)) GTEST_SKIP() << "no capture in " << scenes::DataFolder() << "; set VOROCAST_DATA"

TEST(IndicatorOnCaptures, IsAsNearToTheTruthAndThePointsAsCgal) {
  const auto truth = scenes::Crane(40);
  SKIP_WITHOUT(truth);
  const OrientedPoints points = scenes::Scan(*truth, 65'386, 0.001, 1);
  const std::vector<Vec3> on_truth = geometry::SampleSurface(*truth, 20'000, 2).positions;
  const scenes::DistanceTo to_truth(*truth);
  struct Result {
    scenes::Distances points, truth, surface;
  };
  const auto measure = [&](IndicatorMethod method) {
    const auto surface = SurfaceFromPoints(points, {.method = method}, nullptr);
    EXPECT_TRUE(surface.ok()) << surface.status();
    EXPECT_TRUE(geometry::IsClosed(surface->mesh));
    EXPECT_NEAR(geometry::SignedVolume(surface->mesh), geometry::SignedVolume(*truth), 0.005 * geometry::SignedVolume(*truth));
    const scenes::DistanceTo to_surface(surface->mesh);
    return Result{scenes::Measure(points.positions, to_surface), scenes::Measure(on_truth, to_surface),
                  scenes::Measure(geometry::SampleSurface(surface->mesh, 20'000, 3).positions, to_truth)};
  };
  const Result fast = measure(IndicatorMethod::kSpectral);
  const Result cgal = measure(IndicatorMethod::kCgal);
  // "As near": within the scatter of the samples the distances are measured with.
  constexpr double kScatter = 1.03;
  EXPECT_LE(fast.points.mean, kScatter * cgal.points.mean);
  EXPECT_LE(fast.points.percentile95, kScatter * cgal.points.percentile95);
  EXPECT_LE(fast.truth.mean, kScatter * cgal.truth.mean);
  EXPECT_LE(fast.truth.percentile95, kScatter * cgal.truth.percentile95);
  EXPECT_LE(fast.surface.mean, kScatter * cgal.surface.mean);
  EXPECT_LE(fast.surface.percentile95, kScatter * cgal.surface.percentile95);
  EXPECT_LT(fast.truth.mean, 0.0005);
}

TEST(IndicatorOnCaptures, KeepsAFigureInOnePieceInEveryPose) {
  for (int frame : {0, 60, 174}) {
    const auto truth = scenes::Crane(frame);
    SKIP_WITHOUT(truth);
    IndicatorSummary summary;
    const auto surface = SurfaceFromPoints(scenes::Scan(*truth, 65'386, 0.001, 5), {}, &summary);
    ASSERT_TRUE(surface.ok()) << surface.status();
    EXPECT_TRUE(geometry::IsClosed(surface->mesh)) << frame;
    EXPECT_NEAR(geometry::SignedVolume(surface->mesh), geometry::SignedVolume(*truth), 0.01 * geometry::SignedVolume(*truth)) << frame;
    EXPECT_LT(scenes::Measure(geometry::SampleSurface(surface->mesh, 10'000, 6).positions, scenes::DistanceTo(*truth)).mean, 0.0005) << frame;
    // The captured meshes overlap themselves between the legs; points inside there are on no surface.
    EXPECT_LT(summary.points_far, 1'000) << frame;
  }
}

TEST(IndicatorOnCaptures, DoesNotFoldWhereTheLegsTouch) {
  // In this scan the fit turned triangles over between the legs before it was held back.
  const auto truth = scenes::Crane(60);
  SKIP_WITHOUT(truth);
  const auto surface = SurfaceFromPoints(scenes::Scan(*truth, 65'386, 0.001, 1), {}, nullptr);
  ASSERT_TRUE(surface.ok()) << surface.status();
  EXPECT_FALSE(CrossesItself(surface->mesh));
}

TEST(IndicatorOnCaptures, ClosesANoisyPersonWithoutFeet) {
  for (int frame : {380, 400}) {
    const auto points = scenes::Kinoptic(frame);
    SKIP_WITHOUT(points);
    IndicatorSummary summary;
    const auto surface = SurfaceFromPoints(*points, {}, &summary);
    ASSERT_TRUE(surface.ok()) << surface.status();
    EXPECT_TRUE(geometry::IsClosed(surface->mesh));
    const double volume = geometry::SignedVolume(surface->mesh);
    EXPECT_GT(volume, 0.04);
    EXPECT_LT(volume, 0.1);
    EXPECT_LT(summary.distance_mean_m, 0.006);
    EXPECT_LT(summary.points_dropped_shells, static_cast<std::int64_t>(points->size() / 50));
  }
}

TEST(IndicatorOnCaptures, TakesAMeshAsItIsOrUnitesIt) {
  const auto truth = scenes::Crane(100);
  SKIP_WITHOUT(truth);
  IndicatorSummary summary;
  const auto surface = SurfaceFromMesh(*truth, {}, &summary);
  ASSERT_TRUE(surface.ok()) << surface.status();
  EXPECT_TRUE(geometry::IsClosed(surface->mesh));
  EXPECT_NEAR(geometry::SignedVolume(surface->mesh), geometry::SignedVolume(*truth), 0.01 * geometry::SignedVolume(*truth));
  EXPECT_LT(scenes::Measure(geometry::SampleSurface(surface->mesh, 10'000, 6).positions, scenes::DistanceTo(*truth)).percentile95, 0.001);
}

}  // namespace
}  // namespace vorocast::cvt
