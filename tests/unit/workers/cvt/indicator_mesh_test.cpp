// SPDX-License-Identifier: AGPL-3.0-or-later
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "services/base/random.h"
#include "services/geometry/triangle_mesh.h"
#include "workers/cvt/self_intersection.h"
#include "workers/cvt/shells.h"
#include "workers/cvt/surface_from_mesh.h"
#include "workers/cvt/winding_grid.h"

namespace vorocast::cvt {
namespace {

using geometry::TriangleMesh;
using geometry::Vec3;
using testing::HasSubstr;

/// A box as 12 triangles; without_lid leaves out the two at its highest y.
TriangleMesh Box(const Vec3& low, const Vec3& high, bool without_lid = false) {
  TriangleMesh mesh;
  for (int c = 0; c < 8; ++c) mesh.vertices.emplace_back((c & 1 ? high : low)[0], (c & 2 ? high : low)[1], (c & 4 ? high : low)[2]);
  mesh.triangles = {{0, 4, 6}, {0, 6, 2}, {1, 3, 7}, {1, 7, 5}, {0, 1, 5}, {0, 5, 4},
                    {0, 2, 3}, {0, 3, 1}, {4, 5, 7}, {4, 7, 6}, {2, 6, 7}, {2, 7, 3}};
  if (without_lid) mesh.triangles.resize(10);
  return mesh;
}

TriangleMesh Together(TriangleMesh a, const TriangleMesh& b) {
  const auto shift = static_cast<std::int32_t>(a.vertices.size());
  a.vertices.insert(a.vertices.end(), b.vertices.begin(), b.vertices.end());
  for (const auto& t : b.triangles) a.triangles.push_back({t[0] + shift, t[1] + shift, t[2] + shift});
  return a;
}

TEST(SurfaceFromMesh, LeavesACleanSolidAsItIs) {
  const TriangleMesh box = Box(Vec3(0, 0, 0), Vec3(1, 2, 0.5));
  ASSERT_TRUE(geometry::IsClosed(box));
  const auto surface = SurfaceFromMesh(box, {}, nullptr);
  ASSERT_TRUE(surface.ok()) << surface.status();
  EXPECT_EQ(surface->mesh.triangles, box.triangles);
  EXPECT_EQ(surface->mesh.vertices, box.vertices);
}

TEST(SurfaceFromMesh, UnitesPartsThatOverlap) {
  const TriangleMesh cross = Together(Box(Vec3(0, 0, 0), Vec3(1, 0.3, 0.3)), Box(Vec3(0.35, -0.35, 0.01), Vec3(0.65, 0.65, 0.29)));
  ASSERT_TRUE(CrossesItself(cross));
  IndicatorSummary summary;
  const auto surface = SurfaceFromMesh(cross, {}, &summary);
  ASSERT_TRUE(surface.ok()) << surface.status();
  EXPECT_TRUE(geometry::IsClosed(surface->mesh));
  EXPECT_EQ(FindShells(surface->mesh).count, 1);
  const double volume = 0.3 * 0.3 + 0.3 * 1 * 0.28 - 0.3 * 0.3 * 0.28;
  EXPECT_NEAR(geometry::SignedVolume(surface->mesh), volume, 0.01 * volume);
  EXPECT_LE(summary.spacing_m, 0.01);
}

TEST(SurfaceFromMesh, TakesEdgesWithFourTriangles) {
  // Two boxes that share an edge: closed as a chain, but not edge-manifold.
  TriangleMesh boxes = Together(Box(Vec3(0, 0, 0), Vec3(0.5, 0.5, 0.5)), Box(Vec3(0.5, 0.5, 0), Vec3(1, 1, 0.5)));
  for (auto& t : boxes.triangles) {
    for (std::int32_t& v : t) {
      if (v == 8 || v == 12) v = v == 8 ? 3 : 7;
    }
  }
  ASSERT_FALSE(geometry::IsClosed(boxes));
  ASSERT_TRUE(IsWithoutBorder(boxes));
  const auto surface = SurfaceFromMesh(boxes, {}, nullptr);
  ASSERT_TRUE(surface.ok()) << surface.status();
  EXPECT_TRUE(geometry::IsClosed(surface->mesh));
  EXPECT_NEAR(geometry::SignedVolume(surface->mesh), 0.25, 0.0025);
}

TEST(SurfaceFromMesh, ClosesAMeshWithAHole) {
  const TriangleMesh open = Box(Vec3(0, 0, 0), Vec3(0.5, 2, 0.5), true);
  ASSERT_FALSE(IsWithoutBorder(open));
  const auto surface = SurfaceFromMesh(open, {}, nullptr);
  ASSERT_TRUE(surface.ok()) << surface.status();
  EXPECT_TRUE(geometry::IsClosed(surface->mesh));
  EXPECT_NEAR(geometry::SignedVolume(surface->mesh), 0.5, 0.05);
}

TEST(SurfaceFromMesh, SaysWhatIsWrong) {
  TriangleMesh inside_out = Box(Vec3::Zero(), Vec3::Ones());
  for (auto& t : inside_out.triangles) std::swap(t[0], t[1]);
  EXPECT_THAT(std::string(SurfaceFromMesh(inside_out, {}, nullptr).status().message()), HasSubstr("face outward"));
  EXPECT_THAT(std::string(SurfaceFromMesh({}, {}, nullptr).status().message()), HasSubstr("no triangles"));
  TriangleMesh broken = Box(Vec3::Zero(), Vec3::Ones());
  broken.triangles[5][1] = 8;
  EXPECT_THAT(std::string(SurfaceFromMesh(broken, {}, nullptr).status().message()), HasSubstr("triangle 5 has vertex 8"));
  broken.triangles[5][1] = 5;
  broken.vertices[2][0] = NAN;
  EXPECT_THAT(std::string(SurfaceFromMesh(broken, {}, nullptr).status().message()), HasSubstr("1 of 8 vertices are not finite"));
}

TEST(CutWindingNumber, PutsVerticesOnASphereThatTouchesGridLines) {
  // A polyhedral ball whose vertices lie exactly on grid nodes and lines: every tie must be broken the same way for all triangles.
  ScalarGrid ball;
  ball.frame = {Vec3(-1, -1, -1), 0.125, {17, 17, 17}};
  for (int i = 0; i < 17; ++i) {
    for (int j = 0; j < 17; ++j) {
      for (int k = 0; k < 17; ++k) ball.value.push_back((Vec3(i, j, k) - Vec3::Constant(8)).norm() <= 6 ? 1 : -1);
    }
  }
  const TriangleMesh stepped = MarchingCubes(ball, [](std::size_t, std::size_t) { return 0.5; }).mesh;
  for (double shift : {0.0, 0.0625}) {
    const GridFrame frame{Vec3::Constant(-1 - shift), 0.0625, {36, 36, 36}};
    const TriangleMesh cut = CutWindingNumber(stepped, frame).mesh;
    ASSERT_TRUE(geometry::IsClosed(cut));
    EXPECT_EQ(FindShells(cut).count, 1);
    EXPECT_NEAR(geometry::SignedVolume(cut), geometry::SignedVolume(stepped), 0.02 * geometry::SignedVolume(stepped));
  }
}

TEST(CrossesItself, FindsASpikeThroughTheOtherSide) {
  TriangleMesh box = Box(Vec3::Zero(), Vec3::Ones());
  EXPECT_FALSE(CrossesItself(box));
  box.vertices[7] = Vec3(-1, 0.4, 0.5);
  EXPECT_TRUE(CrossesItself(box));
}

}  // namespace
}  // namespace vorocast::cvt
