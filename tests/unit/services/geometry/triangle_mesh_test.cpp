// SPDX-License-Identifier: AGPL-3.0-or-later
#include "services/geometry/triangle_mesh.h"

#include <gtest/gtest.h>

namespace vorocast::geometry {
namespace {

/// A tetrahedron with right angles at the origin and legs of one metre: volume 1/6, area 3/2 + √3/2.
TriangleMesh CornerTetrahedron() { return {{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}}, {{0, 2, 1}, {0, 1, 3}, {0, 3, 2}, {1, 2, 3}}, {}}; }

TEST(TriangleMesh, VolumeAndAreaOfATetrahedron) {
  EXPECT_NEAR(SignedVolume(CornerTetrahedron()), 1.0 / 6, 1e-15);
  EXPECT_NEAR(SurfaceArea(CornerTetrahedron()), 1.5 + std::sqrt(3) / 2, 1e-15);
}

TEST(TriangleMesh, KnowsAClosedMesh) {
  TriangleMesh mesh = CornerTetrahedron();
  EXPECT_TRUE(IsClosed(mesh));
  mesh.triangles.pop_back();
  EXPECT_FALSE(IsClosed(mesh));
  mesh.triangles.push_back({1, 3, 2});  // closed again, but turned inside out
  EXPECT_FALSE(IsClosed(mesh));
}

TEST(SampleSurface, SpreadsPointsByArea) {
  const OrientedPoints points = SampleSurface(CornerTetrahedron(), 30000, 7);
  ASSERT_EQ(points.size(), 30000u);
  int on_slanted_face = 0;
  for (std::size_t i = 0; i < points.size(); ++i) {
    if (points.normals[i].x() > 0.1) {
      ++on_slanted_face;
      EXPECT_NEAR(points.positions[i].sum(), 1, 1e-12);
    }
  }
  const double expected = (std::sqrt(3) / 2) / (1.5 + std::sqrt(3) / 2);
  EXPECT_NEAR(on_slanted_face / 30000.0, expected, 0.015);  // five standard deviations
}

}  // namespace
}  // namespace vorocast::geometry
