// SPDX-License-Identifier: AGPL-3.0-or-later
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/unit/workers/cvt/cell_scenes.h"
#include "workers/cvt/tessellate.h"

namespace vorocast::cvt {
namespace {

using geometry::TriangleMesh;
using geometry::Vec3;

ClippedMoments Evaluate(const Shape& shape, const std::vector<Vec3>& sites, Neighbours neighbours = Neighbours::kGrid) {
  auto moments = EvaluateClippedCells(shape, sites, neighbours);
  EXPECT_TRUE(moments.ok()) << moments.status();
  if (moments.ok()) return *std::move(moments);
  const std::vector<double> none(sites.size(), 0);
  const std::vector<Vec3> nowhere(sites.size(), Vec3::Zero());
  return {none, nowhere, none, 0, nowhere};
}

/// A box about a point: ∫ |x − site|² over [low, high].
double BoxSecondMoment(const Vec3& low, const Vec3& high, const Vec3& site) {
  const Vec3 size = high - low;
  double sum = 0;
  for (int a = 0; a < 3; ++a) {
    const double p = low[a] - site[a];
    const double q = high[a] - site[a];
    sum += (q * q * q - p * p * p) / 3 / size[a];
  }
  return sum * size.prod();
}

TEST(EvaluateClippedCells, EightCubesInACubeAlthoughEveryCornerIsATie) {
  const Shape shape = scenes::ShapeOf(scenes::Box(Vec3::Zero(), Vec3::Ones()));
  std::vector<Vec3> sites;
  for (int i = 0; i < 8; ++i) sites.emplace_back(i & 1 ? 0.75 : 0.25, i & 2 ? 0.75 : 0.25, i & 4 ? 0.75 : 0.25);
  const ClippedMoments m = Evaluate(shape, sites);
  ASSERT_EQ(m.volume.size(), 8u);
  for (int i = 0; i < 8; ++i) {
    EXPECT_NEAR(m.volume[i], 0.125, 1e-8);
    EXPECT_NEAR((m.centroid[i] - sites[i]).norm(), 0, 1e-8);
    EXPECT_NEAR(m.gradient[i].norm(), 0, 1e-8);
    EXPECT_NEAR(m.second_moment[i], 0.125 * 0.25 / 4, 1e-9);
  }
  EXPECT_NEAR(m.energy, 0.0625, 1e-8);
}

TEST(EvaluateClippedCells, ABoxCutByAPlane) {
  const Vec3 low(0.1, -0.2, 3);
  const Vec3 high(1.1, 0.5, 3.4);
  const Shape shape = scenes::ShapeOf(scenes::Box(low, high));
  const std::vector<Vec3> sites{{0.4, 0.1, 3.1}, {0.7, 0.1, 3.1}};
  const ClippedMoments m = Evaluate(shape, sites);
  const Vec3 split_high(0.55, high.y(), high.z());
  const Vec3 split_low(0.55, low.y(), low.z());
  EXPECT_NEAR(m.volume[0], 0.45 * 0.7 * 0.4, 1e-12);
  EXPECT_NEAR(m.volume[1], 0.55 * 0.7 * 0.4, 1e-12);
  EXPECT_NEAR((m.centroid[0] - (low + split_high) / 2).norm(), 0, 1e-12);
  EXPECT_NEAR((m.centroid[1] - (split_low + high) / 2).norm(), 0, 1e-12);
  EXPECT_NEAR(m.second_moment[0], BoxSecondMoment(low, split_high, sites[0]), 1e-12);
  EXPECT_NEAR(m.second_moment[1], BoxSecondMoment(split_low, high, sites[1]), 1e-12);
  EXPECT_NEAR((m.gradient[0] - 2 * m.volume[0] * (sites[0] - m.centroid[0])).norm(), 0, 1e-12);
}

TEST(EvaluateClippedCells, OneSiteHasTheWholeShapeEvenFromOutside) {
  const Shape shape = scenes::ShapeOf(scenes::Torus(0.5, 0.2, 40, 20));
  for (const Vec3& site : {Vec3(0.5, 0, 0), Vec3(0, 0, 0), Vec3(2, 1, 0.3)}) {
    const ClippedMoments m = Evaluate(shape, {site});
    EXPECT_NEAR(m.volume[0], geometry::SignedVolume(shape.surface), 1e-12);
    EXPECT_NEAR(m.centroid[0].norm(), 0, 1e-10);
  }
}

TEST(EvaluateClippedCells, AShellInsideACellCountsAsACavity) {
  // The inner sphere touches no face of the cells: only the volume can tell in from out.
  const Shape shape =
      scenes::ShapeOf(scenes::Join(scenes::Box(Vec3(-1, -1, -1), Vec3(1, 1, 1)), scenes::Reversed(scenes::Sphere(Vec3(-0.5, 0, 0), 0.2, 6))));
  const double hole = geometry::SignedVolume(scenes::Sphere(Vec3(-0.5, 0, 0), 0.2, 6));
  const ClippedMoments m = Evaluate(shape, {Vec3(-0.5, 0.1, 0), Vec3(0.5, 0.1, 0)});
  EXPECT_NEAR(m.volume[0], 4 - hole, 1e-12);
  EXPECT_NEAR(m.volume[1], 4, 1e-12);
}

TEST(EvaluateClippedCells, ASiteWhoseCellLiesOutsideHasNone) {
  const Shape shape = scenes::ShapeOf(scenes::Sphere(Vec3::Zero(), 0.5, 8));
  const ClippedMoments m = Evaluate(shape, {Vec3(0.1, 0, 0), Vec3(-0.1, 0, 0), Vec3(2, 0, 0), Vec3(4, 0, 0)});
  EXPECT_EQ(m.volume[2], 0);
  EXPECT_EQ(m.volume[3], 0);
  EXPECT_NEAR(m.volume[0] + m.volume[1], geometry::SignedVolume(shape.surface), 1e-12);
}

class OnShapes : public testing::TestWithParam<int> {
 protected:
  static TriangleMesh Mesh() {
    switch (GetParam()) {
      case 0:
        return scenes::LShape();
      case 1:
        return scenes::Torus(0.5, 0.2, 24, 12);
      case 2:
        return scenes::Join(scenes::Sphere(Vec3(0, 0, 0), 0.5, 6), scenes::Reversed(scenes::Sphere(Vec3(0, 0.01, 0), 0.4, 5)));
      default:
        return scenes::Join(scenes::LShape(), scenes::Box(Vec3(0.25, 0.25, 0.03), Vec3(0.4, 0.4, 0.2)));
    }
  }
};

TEST_P(OnShapes, MomentsAgreeWithRandomPoints) {
  const TriangleMesh mesh = Mesh();
  const Shape shape = scenes::ShapeOf(mesh);
  const std::vector<Vec3> sites = scenes::PointsInside(mesh, 40, 3);
  const ClippedMoments m = Evaluate(shape, sites);
  constexpr std::size_t kPoints = 20'000;
  const std::vector<Vec3> points = scenes::PointsInside(mesh, kPoints, 4);
  double total = 0;
  for (double v : m.volume) total += v;
  EXPECT_NEAR(total, geometry::SignedVolume(mesh), 1e-9 * total);
  if (shape.component_count > 1) return;  // nearest sites do not know of solids
  std::vector<double> count(sites.size(), 0);
  double energy = 0;
  std::vector<Vec3> sum(sites.size(), Vec3::Zero());
  for (const Vec3& p : points) {
    const std::size_t i = scenes::Nearest(sites, p);
    ++count[i];
    sum[i] += p;
    energy += (p - sites[i]).squaredNorm() * total / kPoints;
  }
  for (std::size_t i = 0; i < sites.size(); ++i) {
    const double share = m.volume[i] / total;
    EXPECT_NEAR(count[i] / kPoints, share, 5 * std::sqrt(share / kPoints) + 1e-4) << i;
    const double radius = std::sqrt(m.second_moment[i] / m.volume[i]);
    if (count[i] > 30) {
      EXPECT_LT((sum[i] / count[i] - m.centroid[i]).norm(), 5 * radius / std::sqrt(count[i])) << i;
    }
  }
  EXPECT_NEAR(m.energy, energy, 0.04 * energy);
}

TEST_P(OnShapes, TheGradientIsThatOfTheEnergy) {
  const TriangleMesh mesh = Mesh();
  const Shape shape = scenes::ShapeOf(mesh);
  std::vector<Vec3> sites = scenes::PointsInside(mesh, 40, 5);
  const ClippedMoments m = Evaluate(shape, sites);
  const double step = 1e-5;
  for (std::size_t i = 0; i < sites.size(); i += 7) {
    for (int a = 0; a < 3; ++a) {
      const Vec3 site = sites[i];
      sites[i][a] = site[a] + step;
      const double above = Evaluate(shape, sites).energy;
      sites[i][a] = site[a] - step;
      const double below = Evaluate(shape, sites).energy;
      sites[i] = site;
      EXPECT_NEAR((above - below) / (2 * step), m.gradient[i][a], 1e-6 * m.energy / 0.1) << i << " " << a;
    }
  }
}

TEST_P(OnShapes, TetGenFindsTheSameNeighbours) {
  const TriangleMesh mesh = Mesh();
  const Shape shape = scenes::ShapeOf(mesh);
  const std::vector<Vec3> sites = scenes::PointsInside(mesh, 300, 6);
  const ClippedMoments grid = Evaluate(shape, sites);
  const ClippedMoments delaunay = Evaluate(shape, sites, Neighbours::kTetGen);
  EXPECT_NEAR(grid.energy, delaunay.energy, 1e-10 * grid.energy);
  for (std::size_t i = 0; i < sites.size(); ++i) EXPECT_NEAR(grid.volume[i], delaunay.volume[i], 1e-9 * grid.volume[i]) << i;
}

INSTANTIATE_TEST_SUITE_P(Shapes, OnShapes, testing::Range(0, 4));

TEST(EvaluateClippedCells, SitesAtOnePlaceAreTakenApart) {
  const Shape shape = scenes::ShapeOf(scenes::LShape());
  const ClippedMoments m = Evaluate(shape, {Vec3(0.1, 0.1, 0.1), Vec3(0.1, 0.1, 0.1), Vec3(0.2, 0.1, 0.1)});
  EXPECT_NEAR(m.volume[0] + m.volume[1] + m.volume[2], shape.component_volume[0], 1e-9);
}

TEST(EvaluateClippedCells, SaysWhatIsWrong) {
  const Shape shape = scenes::ShapeOf(scenes::LShape());
  EXPECT_FALSE(EvaluateClippedCells(shape, {}, Neighbours::kGrid).ok());
  EXPECT_THAT(std::string(EvaluateClippedCells(shape, {Vec3(0.1, 0.1, 0.1), Vec3(NAN, 0, 0)}, Neighbours::kGrid).status().message()),
              testing::HasSubstr("site 1"));
  EXPECT_FALSE(EvaluateClippedCells({}, {Vec3(0, 0, 0)}, Neighbours::kGrid).ok());
}

}  // namespace
}  // namespace vorocast::cvt
