// SPDX-License-Identifier: AGPL-3.0-or-later
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "services/base/random.h"
#include "services/geometry/triangle_mesh.h"
#include "workers/cvt/marching_cubes.h"
#include "workers/cvt/marching_cubes_table.h"

namespace vorocast::cvt {
namespace {

using geometry::Vec3;

template <typename Function>
ScalarGrid Sample(std::array<std::int32_t, 3> nodes, double spacing, Function&& function) {
  ScalarGrid grid;
  grid.frame = {Vec3(-1, -1, -1), spacing, nodes};
  for (std::int32_t i = 0; i < nodes[0]; ++i) {
    for (std::int32_t j = 0; j < nodes[1]; ++j) {
      for (std::int32_t k = 0; k < nodes[2]; ++k) grid.value.push_back(static_cast<float>(function(grid.frame.origin + spacing * Vec3(i, j, k))));
    }
  }
  return grid;
}

TEST(MarchingCubesTable, UsesExactlyTheCrossedEdgesOfEachCase) {
  for (std::uint32_t inside = 0; inside < 256; ++inside) {
    std::array<bool, 12> used{};
    for (const CubeTriangle& triangle : MarchingCubesTable()[inside]) {
      for (std::int8_t edge : triangle) used[static_cast<std::size_t>(edge)] = true;
    }
    for (std::uint32_t axis = 0; axis < 3; ++axis) {
      for (std::uint32_t offset = 0; offset < 4; ++offset) {
        const std::uint32_t from = (offset & 1) << (axis + 1) % 3 | (offset >> 1) << (axis + 2) % 3;
        const bool crossed = (inside >> from & 1) != (inside >> (from | 1U << axis) & 1);
        EXPECT_EQ(used[4 * axis + offset], crossed) << "case " << inside << " axis " << axis << " offset " << offset;
      }
    }
  }
}

TEST(MarchingCubes, IsClosedAndEdgeManifoldOnRandomSigns) {
  for (std::uint64_t seed = 1; seed <= 8; ++seed) {
    base::Random random(seed);
    // Odd sizes, so that the eight-node steps end inside a row; all cases and all ambiguous faces occur.
    const ScalarGrid grid = Sample({17, 19, 23}, 0.1, [&](const Vec3&) { return random.Uniform(-1, 1); });
    const GridSurface surface = MarchingCubes(grid);
    ASSERT_FALSE(surface.mesh.triangles.empty());
    EXPECT_TRUE(geometry::IsClosed(surface.mesh)) << "seed " << seed;
    EXPECT_GT(geometry::SignedVolume(surface.mesh), 0);
    ASSERT_EQ(surface.triangle_cell.size(), surface.mesh.triangles.size());
    EXPECT_TRUE(std::ranges::is_sorted(surface.triangle_cell));
  }
}

TEST(MarchingCubes, HasTheVolumeAndAreaOfABall) {
  constexpr double kRadius = 0.7;
  const ScalarGrid grid = Sample({50, 49, 48}, 0.043, [](const Vec3& x) { return kRadius - x.norm(); });
  const geometry::TriangleMesh mesh = MarchingCubes(grid).mesh;
  ASSERT_TRUE(geometry::IsClosed(mesh));
  EXPECT_NEAR(geometry::SignedVolume(mesh), 4.0 / 3 * std::numbers::pi * std::pow(kRadius, 3), 0.005);
  EXPECT_NEAR(geometry::SurfaceArea(mesh), 4 * std::numbers::pi * kRadius * kRadius, 0.03);
  for (const Vec3& x : mesh.vertices) EXPECT_NEAR(x.norm(), kRadius, 0.003);
}

TEST(MarchingCubes, ClosesWhatReachesTheBorder) {
  const ScalarGrid grid = Sample({20, 21, 22}, 0.1, [](const Vec3&) { return 1.0; });
  const geometry::TriangleMesh mesh = MarchingCubes(grid).mesh;
  EXPECT_TRUE(geometry::IsClosed(mesh));
  // Inside from node 1 to node n − 2 and half a cell beyond; only edges and corners of the box are cut.
  EXPECT_NEAR(geometry::SignedVolume(mesh), 1.8 * 1.9 * 2.0, 0.05);
}

TEST(MarchingCubes, KeepsCrossingsAwayFromNodes) {
  const ScalarGrid grid = Sample({12, 12, 12}, 0.2, [](const Vec3& x) { return 0.6 - std::max({std::abs(x[0]), std::abs(x[1]), std::abs(x[2])}); });
  const geometry::TriangleMesh mesh = MarchingCubes(grid).mesh;
  ASSERT_TRUE(geometry::IsClosed(mesh));
  for (const auto& t : mesh.triangles) {
    const auto corner = [&](std::size_t i) { return mesh.vertices[static_cast<std::size_t>(t[i])]; };
    EXPECT_GT((corner(1) - corner(0)).cross(corner(2) - corner(0)).norm(), 1e-5);
  }
}

TEST(MarchingCubes, IsEmptyWhereNothingIsInside) {
  EXPECT_TRUE(MarchingCubes(Sample({9, 9, 9}, 0.1, [](const Vec3&) { return -1.0; })).mesh.triangles.empty());
}

}  // namespace
}  // namespace vorocast::cvt
