// SPDX-License-Identifier: AGPL-3.0-or-later
#include "workers/cvt/shape.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/unit/workers/cvt/cell_scenes.h"

namespace vorocast::cvt {
namespace {

using geometry::TriangleMesh;
using geometry::Vec3;

TEST(ShapeFromSurface, SortsSeparateSolidsByVolume) {
  const TriangleMesh small = scenes::Box(Vec3(0, 0, 0), Vec3(1, 1, 1));
  const TriangleMesh large = scenes::Box(Vec3(3, 0, 0), Vec3(5, 1, 1));
  const auto shape = ShapeFromSurface(scenes::Join(small, large), 1e-6);
  ASSERT_TRUE(shape.ok()) << shape.status();
  ASSERT_EQ(shape->component_count, 2);
  EXPECT_NEAR(shape->component_volume[0], 2, 1e-12);
  EXPECT_NEAR(shape->component_volume[1], 1, 1e-12);
  for (std::size_t t = 0; t < shape->surface.triangles.size(); ++t) {
    const bool far = shape->surface.vertices[shape->surface.triangles[t][0]].x() > 2;
    EXPECT_EQ(shape->triangle_component[t], far ? 0 : 1);
  }
}

TEST(ShapeFromSurface, CavitiesBelongToTheSolidAroundThemAndMayHoldAnother) {
  const TriangleMesh wall = scenes::Box(Vec3(0, 0, 0), Vec3(10, 10, 10));
  const TriangleMesh cavity = scenes::Reversed(scenes::Box(Vec3(2, 2, 2), Vec3(8, 8, 8)));
  const TriangleMesh core = scenes::Box(Vec3(4, 4, 4), Vec3(5, 5, 5));
  const TriangleMesh core_cavity = scenes::Reversed(scenes::Box(Vec3(4.2, 4.2, 4.2), Vec3(4.7, 4.7, 4.7)));
  const auto shape = ShapeFromSurface(scenes::Join(scenes::Join(core_cavity, core), scenes::Join(cavity, wall)), 1e-6);
  ASSERT_TRUE(shape.ok()) << shape.status();
  ASSERT_EQ(shape->component_count, 2);
  EXPECT_NEAR(shape->component_volume[0], 1000 - 216, 1e-9);
  EXPECT_NEAR(shape->component_volume[1], 1 - 0.125, 1e-12);
}

TEST(ShapeFromSurface, DropsWhatIsTooSmallWithItsVertices) {
  const TriangleMesh speck = scenes::Box(Vec3(5, 5, 5), Vec3(5.01, 5.01, 5.01));
  const auto shape = ShapeFromSurface(scenes::Join(speck, scenes::LShape()), 1e-3);
  ASSERT_TRUE(shape.ok()) << shape.status();
  EXPECT_EQ(shape->component_count, 1);
  EXPECT_EQ(shape->surface.vertices.size(), scenes::LShape().vertices.size());
  EXPECT_TRUE(geometry::IsClosed(shape->surface));
}

TEST(ShapeFromSurface, SaysWhatIsWrong) {
  TriangleMesh open = scenes::LShape();
  open.triangles.pop_back();
  EXPECT_THAT(std::string(ShapeFromSurface(open, 0).status().message()), testing::HasSubstr("not closed"));
  EXPECT_THAT(std::string(ShapeFromSurface(scenes::Reversed(scenes::LShape()), 0).status().message()), testing::HasSubstr("inside out"));
  EXPECT_THAT(std::string(ShapeFromSurface({}, 0).status().message()), testing::HasSubstr("no triangle"));
  EXPECT_THAT(std::string(ShapeFromSurface(scenes::LShape(), 100).status().message()), testing::HasSubstr("empty"));
  TriangleMesh beyond = scenes::LShape();
  beyond.triangles[0][0] = 1000;
  EXPECT_THAT(std::string(ShapeFromSurface(beyond, 0).status().message()), testing::HasSubstr("vertex 1000"));
}

}  // namespace
}  // namespace vorocast::cvt
