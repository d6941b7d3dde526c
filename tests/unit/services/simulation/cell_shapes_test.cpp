// SPDX-License-Identifier: AGPL-3.0-or-later
#include "services/simulation/cell_shapes.h"

#include <gtest/gtest.h>

#include "tests/unit/services/simulation/synthetic_take.h"

namespace vorocast::simulation {
namespace {

using geometry::Cells;
using geometry::Vec3;
using testing::AddCell;
using testing::CubeCell;
using testing::LatticeCell;

constexpr double kShrink = 0.0003;

TEST(CellShapes, ACubeKeepsItsMassAndInertiaAndShrinksByMarginAndGap) {
  Cells cells;
  AddCell(cells, CubeCell(0.04), Vec3(1, 2, 3));
  const CellShape shape = MakeCellShapes(cells, {.density_kg_m3 = 500, .shrink_m = kShrink})[0];
  EXPECT_NEAR(shape.mass, 500 * 0.04 * 0.04 * 0.04, 1e-12);
  for (int axis = 0; axis < 3; ++axis) EXPECT_NEAR(shape.inertia[axis], shape.mass * 0.04 * 0.04 / 6, 1e-6 * shape.mass * 0.04 * 0.04);
  ASSERT_EQ(shape.hull.size(), 8U);
  for (const Vec3& corner : shape.hull) {
    EXPECT_LT(((shape.cell_from_body * corner).cwiseAbs() - Vec3::Constant(0.02 - kHullMargin - kShrink)).norm(),
              3e-6);  // the hull is computed in integers
  }
}

TEST(CellShapes, InertiaOfABrickIsTheTextbooks) {
  Cells cells;
  testing::Polyhedron brick = CubeCell(1);
  const Vec3 size(0.02, 0.03, 0.05);
  for (Vec3& vertex : brick.vertices) vertex = vertex.cwiseProduct(size);
  brick.volume = size.prod();
  AddCell(cells, brick, Vec3(0, 0, 0));
  const CellShape shape = MakeCellShapes(cells, {})[0];
  // The body's axes are the brick's in some order: compare in the cell's frame.
  const geometry::Mat3 axes = shape.cell_from_body.toRotationMatrix();
  const geometry::Mat3 inertia = axes * shape.inertia.asDiagonal() * axes.transpose();
  const Vec3 squares = size.cwiseAbs2();
  const geometry::Mat3 expected = (shape.mass / 12 * (Vec3::Constant(squares.sum()) - squares)).asDiagonal();
  EXPECT_LT((inertia - expected).norm(), 1e-4 * expected.norm());
}

TEST(CellShapes, HullsAreThinnedOutInsideTheCell) {
  Cells cells;
  AddCell(cells, LatticeCell(0.03), Vec3(0, 1, 0));
  const CellShape shape = MakeCellShapes(cells, {})[0];
  EXPECT_EQ(shape.all_corners.size(), 24U);
  EXPECT_EQ(shape.hull.size(), kHullCorners);
  for (const Vec3& corner : shape.hull) EXPECT_LE(corner.norm(), shape.radius);
  EXPECT_LT(shape.radius, 0.03 * std::sqrt(5.0) / 4);
}

TEST(CellShapes, FlatTinyAndEmptyCellsGetSomethingToCollideWith) {
  Cells cells;
  AddCell(cells, CubeCell(0.03), Vec3(0, 0, 0));
  testing::Polyhedron flat = CubeCell(0.03);
  for (Vec3& vertex : flat.vertices) vertex.z() = 0;
  flat.volume = 0;
  AddCell(cells, flat, Vec3(1, 0, 0));
  testing::Polyhedron thin = CubeCell(0.03);
  for (Vec3& vertex : thin.vertices) vertex.z() *= 0.01;
  thin.volume = 0.03 * 0.03 * 0.0003;
  AddCell(cells, thin, Vec3(2, 0, 0));
  AddCell(cells, CubeCell(1e-5), Vec3(3, 0, 0));
  AddCell(cells, {}, Vec3(4, 0, 0));
  testing::Polyhedron negative = CubeCell(0.03);
  negative.volume = -1;
  AddCell(cells, negative, Vec3(5, 0, 0));
  const auto shapes = MakeCellShapes(cells, {});
  ASSERT_EQ(shapes.size(), 6U);
  for (const CellShape& shape : shapes) {
    EXPECT_GT(shape.mass, 0);
    EXPECT_GT(shape.inertia.minCoeff(), 0);
    EXPECT_GE(shape.inertia.minCoeff(), 0.0999 * shape.inertia.maxCoeff());
    geometry::Box3 box;
    for (const Vec3& corner : shape.hull) box.extend(corner);
    EXPECT_GE(box.sizes().minCoeff(), 0.00099);
  }
  EXPECT_GE(shapes[3].mass, 1e-3 * shapes[0].mass);
}

}  // namespace
}  // namespace vorocast::simulation
