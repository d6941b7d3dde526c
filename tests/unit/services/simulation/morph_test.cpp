// SPDX-License-Identifier: AGPL-3.0-or-later
#include "services/simulation/morph.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <random>
#include <set>

#include "services/simulation/assignment.h"
#include "services/simulation/simulate.h"
#include "tests/unit/services/simulation/synthetic_take.h"

namespace vorocast::simulation {
namespace {

using geometry::CellState;
using geometry::Vec3;

CostMatrix RandomCosts(std::size_t rows, std::size_t columns, unsigned seed, int levels) {
  std::mt19937 random(seed);
  CostMatrix costs{.rows = rows, .columns = columns};
  for (std::size_t i = 0; i < rows * columns; ++i) costs.cost.push_back(static_cast<float>(random() % static_cast<unsigned>(levels)));
  return costs;
}

double Total(const CostMatrix& costs, const std::vector<std::int32_t>& column_of) {
  double sum = 0;
  for (std::size_t row = 0; row < costs.rows; ++row) sum += costs.At(row, static_cast<std::size_t>(column_of[row]));
  return sum;
}

double BruteForce(const CostMatrix& costs) {
  std::vector<std::int32_t> order(costs.columns);
  std::iota(order.begin(), order.end(), 0);
  double least = 1e300;
  do least = std::min(least, Total(costs, order));
  while (std::next_permutation(order.begin(), order.end()));
  return least;
}

TEST(Assignment, IsTheLeastOfAllOrders) {
  for (unsigned seed = 0; seed < 60; ++seed) {
    const std::size_t columns = 3 + seed % 5;
    const std::size_t rows = 1 + seed % columns;
    const CostMatrix costs = RandomCosts(rows, columns, seed, seed % 3 == 0 ? 4 : 1000);  // few levels: many ties
    const std::vector<std::int32_t> result = OptimalAssignment(costs);
    EXPECT_EQ(std::set(result.begin(), result.end()).size(), rows);
    EXPECT_EQ(Total(costs, result), BruteForce(costs)) << seed;
  }
}

/// No exchange along a cycle of two or three rows makes a larger assignment cheaper, and no free column does.
TEST(Assignment, LargeOnesCannotBeImproved) {
  const CostMatrix costs = RandomCosts(120, 150, 5, 100000);
  const std::vector<std::int32_t> result = OptimalAssignment(costs);
  const auto at = [&](std::size_t row, std::int32_t column) { return costs.At(row, static_cast<std::size_t>(column)); };
  std::vector<bool> taken(150, false);
  for (const std::int32_t column : result) taken[static_cast<std::size_t>(column)] = true;
  for (std::size_t a = 0; a < 120; ++a) {
    for (std::int32_t column = 0; column < 150; ++column) {
      if (!taken[static_cast<std::size_t>(column)]) {
        EXPECT_GE(at(a, column), at(a, result[a]));
      }
    }
    for (std::size_t b = 0; b < 120; ++b) {
      const double swapped = at(a, result[b]) + at(b, result[a]);
      EXPECT_GE(swapped + 1e-3, at(a, result[a]) + at(b, result[b]));
      for (std::size_t c = 0; c < 120; ++c) {
        if (a == b || b == c || a == c) continue;
        const double turned = at(a, result[b]) + at(b, result[c]) + at(c, result[a]);
        ASSERT_GE(turned + 1e-3, at(a, result[a]) + at(b, result[b]) + at(c, result[c]));
      }
    }
  }
}

TEST(ConvexMorph, IsTheOneAtTheStartAndTheOtherAtTheEnd) {
  const auto cube = testing::CubeCell(0.04);
  const auto lattice = testing::LatticeCell(0.06);
  const ConvexMorph morph = BlendHulls(cube.vertices, lattice.vertices);
  EXPECT_NEAR(morph.Volume(0), cube.volume, 1e-3 * cube.volume);
  EXPECT_NEAR(morph.Volume(1), lattice.volume, 1e-3 * lattice.volume);
  for (const Vec3& x : morph.At(0)) EXPECT_LE(x.cwiseAbs().maxCoeff(), 0.02 + 1e-9);
}

/// Brunn and Minkowski: the cube root of the volume of (1−t) A ⊕ t B is concave. And of a shape with itself, nothing changes.
TEST(ConvexMorph, VolumesStaySane) {
  const auto cube = testing::CubeCell(0.04);
  auto plate = testing::CubeCell(0.06);
  for (Vec3& x : plate.vertices) x.y() *= 0.2;
  const ConvexMorph morph = BlendHulls(cube.vertices, plate.vertices);
  const double a = std::cbrt(morph.Volume(0));
  const double b = std::cbrt(morph.Volume(1));
  double before = 0;
  for (int i = 0; i <= 20; ++i) {
    const double t = i / 20.0;
    const double root = std::cbrt(morph.Volume(t));
    EXPECT_GE(root, (1 - t) * a + t * b - 1e-9);
    EXPECT_LE(root, 1.2 * std::max(a, b));
    if (i > 0) {
      EXPECT_LT(std::abs(root - before), 0.1 * std::max(a, b));  // no jump
    }
    before = root;
    // Every corner is within the box that the two shapes' boxes blend to.
    for (const Vec3& x : morph.At(t)) {
      EXPECT_LE(std::abs(x.x()), (1 - t) * 0.02 + t * 0.03 + 1e-9);
      EXPECT_LE(std::abs(x.y()), (1 - t) * 0.02 + t * 0.006 + 1e-9);
    }
  }
  const ConvexMorph same = BlendHulls(cube.vertices, cube.vertices);
  for (const double t : {0.0, 0.3, 1.0}) EXPECT_NEAR(same.Volume(t), cube.volume, 1e-3 * cube.volume);
}

TEST(ConvexMorph, GrowsFromNothing) {
  const auto cube = testing::CubeCell(0.04);
  const ConvexMorph morph = BlendHulls({}, cube.vertices);
  for (const double t : {0.0, 0.25, 1.0}) EXPECT_NEAR(morph.Volume(t), t * t * t * cube.volume, 1e-3 * cube.volume);
  EXPECT_TRUE(BlendHulls({}, {}).triangles.empty());
}

geometry::TrackedTake BlockTake(int x, int y, int z, double edge) {
  testing::Cells cells = testing::CubeBlock(x, y, z, edge);
  testing::ConnectNeighbours(cells);
  return testing::Animate(std::move(cells), 60, 25, testing::Still);
}

TEST(Morph, ACellOfTheSameBodyStaysWhereItIs) {
  const geometry::TrackedTake a = BlockTake(3, 6, 3, 0.04);
  const TrackedMotion motion(a);
  for (const MorphPair& pair : MatchCells({}, motion, motion)) EXPECT_EQ(pair.source, pair.target);
}

TEST(Morph, UnequalCountsAllArrive) {
  for (const bool grow : {true, false}) {
    const geometry::TrackedTake small = BlockTake(3, 6, 3, 0.05);
    const geometry::TrackedTake large = BlockTake(4, 8, 4, 0.04);
    const geometry::TrackedTake& from = grow ? small : large;
    const geometry::TrackedTake& to = grow ? large : small;
    const TrackedMotion source(from);
    const TrackedMotion target(to);
    geometry::SimulatedTake result = *Simulate(from, {{"name", "x"}}, {});
    const MorphSettings settings{.start_s = 0.4, .end_s = 1.6, .cell_s = 0.5};
    AddMorph(settings, source, target, result);
    const std::size_t pairs = result.morph.source.size();
    ASSERT_EQ(pairs, std::max(from.cell_count(), to.cell_count()));
    const auto everyone = [](std::vector<std::int32_t> list) {
      std::erase(list, -1);
      return std::set(list.begin(), list.end()).size();
    };
    EXPECT_EQ(everyone(result.morph.source), from.cell_count());
    EXPECT_EQ(everyone(result.morph.target), to.cell_count());
    const std::size_t last = result.time.size() - 1;
    double volume_at_end = 0;
    for (std::size_t p = 0; p < pairs; ++p) {
      EXPECT_EQ(result.morph.blend[p], 0);  // nothing at the start
      const std::size_t i = last * pairs + p;
      const std::int32_t cell = result.morph.target[p];
      EXPECT_EQ(result.morph.blend[i], cell < 0 ? 0 : 1);
      if (cell >= 0) {
        EXPECT_LT((result.morph.translation[i].cast<double>() - to.model.cells.centroid[static_cast<std::size_t>(cell)]).norm(), 1e-5);
      }
      volume_at_end += cell < 0 ? 0 : to.model.cells.volume[static_cast<std::size_t>(cell)];
    }
    for (std::size_t c = 0; c < from.cell_count(); ++c) {
      EXPECT_EQ(result.cell_state[c], CellState::kRecalled);
      EXPECT_EQ(result.cell_state[last * from.cell_count() + c], CellState::kGone);
    }
    EXPECT_NEAR(volume_at_end, std::accumulate(to.model.cells.volume.begin(), to.model.cells.volume.end(), 0.0), 1e-12);
  }
}

TEST(Morph, OutsideCellsGoFirst) {
  const geometry::TrackedTake take = BlockTake(5, 5, 5, 0.04);
  const TrackedMotion motion(take);
  const MorphSettings settings{.order = MorphSettings::Order::kOutsideIn, .start_s = 1, .end_s = 3, .cell_s = 0.5, .order_weight_m = 10};
  const std::vector<double>& depth = take.model.cells.depth;
  for (const MorphPair& a : MatchCells(settings, motion, motion)) {
    EXPECT_GE(a.start_s, 1);
    EXPECT_LE(a.start_s, 2.5);
    // With a heavy order weight the outermost become the innermost.
    if (depth[static_cast<std::size_t>(a.source)] > 0.09) {
      EXPECT_LT(depth[static_cast<std::size_t>(a.target)], 0.03);
    }
    for (const MorphPair& b : MatchCells(settings, motion, motion)) {
      if (depth[static_cast<std::size_t>(a.source)] < depth[static_cast<std::size_t>(b.source)] - 1e-9) {
        EXPECT_LE(a.start_s, b.start_s);
      }
    }
    break;
  }
}

}  // namespace
}  // namespace vorocast::simulation
