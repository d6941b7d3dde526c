// SPDX-License-Identifier: AGPL-3.0-or-later
#include "services/geometry/polygon.h"

#include <gtest/gtest.h>

#include <numbers>

#include "services/base/random.h"

namespace vorocast::geometry {
namespace {

Vec3 AreaVector(const std::vector<Vec3>& corners) {
  Vec3 area = Vec3::Zero();
  for (std::size_t i = 0; i < corners.size(); ++i) area += corners[i].cross(corners[(i + 1) % corners.size()]) / 2;
  return area;
}

/// The triangles cover the polygon once: each turns like it, and their areas add up to its own.
void ExpectExactCover(const std::vector<Vec3>& corners) {
  const auto triangles = Triangulate(corners);
  ASSERT_EQ(triangles.size(), corners.size() - 2);
  const Vec3 area = AreaVector(corners);
  double sum = 0;
  for (const auto& t : triangles) {
    const Vec3& a = corners[static_cast<std::size_t>(t[0])];
    const Vec3 part = (corners[static_cast<std::size_t>(t[1])] - a).cross(corners[static_cast<std::size_t>(t[2])] - a) / 2;
    EXPECT_GE(part.dot(area), -1e-12);
    sum += part.norm();
  }
  EXPECT_NEAR(sum, area.norm(), 1e-9);
}

TEST(Triangulate, CoversNonConvexPolygons) {
  ExpectExactCover({{0, 0, 0}, {2, 0, 0}, {2, 1, 0}, {1, 1, 0}, {1, 2, 0}, {0, 2, 0}});                                // an L
  ExpectExactCover({{0, 0, 0}, {0, 2, 0}, {1, 2, 0}, {1, 1, 0}, {2, 1, 0}, {2, 0, 0}});                                // turned round
  ExpectExactCover({{0, 0, 0}, {5, 0, 0}, {5, 2, 0}, {4, 0.2, 0}, {3, 2, 0}, {2, 0.2, 0}, {1, 2, 0}, {0.9, 0.1, 0}});  // a comb
  ExpectExactCover({{0, 0, 0}, {1, 0, 0}, {2, 0, 0}, {2, 2, 0}, {1, 1, 0}, {0, 2, 0}});                                // a corner of 180 degrees
  ExpectExactCover({{0, 0, 1}, {1, 0, 1}, {1, 1, 1}});
}

TEST(Triangulate, CoversRandomStarsInSpace) {
  base::Random random(3);
  for (int round = 0; round < 300; ++round) {
    const auto n = 4 + random.Below(12);
    const Quat rotation(random.Gaussian(), random.Gaussian(), random.Gaussian(), random.Gaussian());
    std::vector<Vec3> corners;
    for (std::uint64_t i = 0; i < n; ++i) {
      const double angle = 2 * std::numbers::pi * static_cast<double>(i) / static_cast<double>(n);
      const double radius = random.Uniform(0.1, 1);
      corners.push_back(rotation.normalized() * Vec3(radius * std::cos(angle), radius * std::sin(angle), 0.3));
    }
    ExpectExactCover(corners);
  }
}

TEST(Triangulate, SurvivesPolygonsWithoutArea) {
  const std::vector<Vec3> line = {{0, 0, 0}, {1, 0, 0}, {2, 0, 0}, {1, 0, 0}, {0.5, 0, 0}};
  EXPECT_EQ(Triangulate(line).size(), 3U);
  EXPECT_TRUE(Triangulate(std::vector<Vec3>{{0, 0, 0}, {1, 0, 0}}).empty());
  EXPECT_TRUE(Triangulate(std::vector<Vec3>{}).empty());
}

}  // namespace
}  // namespace vorocast::geometry
