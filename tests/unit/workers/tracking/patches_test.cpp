// SPDX-License-Identifier: AGPL-3.0-or-later
#include <gtest/gtest.h>

#include <algorithm>
#include <set>

#include "tests/unit/workers/tracking/lattice_cells.h"
#include "tests/unit/workers/tracking/limb.h"
#include "workers/tracking/tracking.h"

namespace vorocast::tracking {
namespace {

using geometry::Vec3;

/// Two limbs side by side that do not touch.
geometry::TriangleMesh TwoLimbs() {
  geometry::TriangleMesh both = LimbMesh();
  const auto count = static_cast<std::int32_t>(both.vertices.size());
  const geometry::TriangleMesh other = Moved(LimbMesh(), {geometry::Quat::Identity(), Vec3(0, 0.4, 0)});
  both.vertices.insert(both.vertices.end(), other.vertices.begin(), other.vertices.end());
  for (const auto& [a, b, c] : other.triangles) both.triangles.push_back({a + count, b + count, c + count});
  return both;
}

std::vector<std::int32_t> Sizes(const std::vector<std::int32_t>& patch) {
  std::vector<std::int32_t> sizes(static_cast<std::size_t>(*std::ranges::max_element(patch)) + 1, 0);
  for (const std::int32_t p : patch) ++sizes[p];
  return sizes;
}

TEST(ClusterPatches, ArePatchesConnected) {
  const geometry::Cells cells = LatticeCells(LimbMesh(), 0.02, Vec3::Zero());
  const auto patch = ClusterPatches(cells, 40, 1).value();
  const auto sizes = Sizes(patch);
  ASSERT_EQ(sizes.size(), 40u);
  const auto pairs = geometry::NeighbourPairs(cells);
  for (std::int32_t p = 0; p < 40; ++p) {
    // Grow from one cell of the patch through cells of the patch: all of them must be reached.
    std::set<std::int32_t> reached{static_cast<std::int32_t>(std::ranges::find(patch, p) - patch.begin())};
    for (std::size_t before = 0; before != reached.size();) {
      before = reached.size();
      for (const auto& [a, b] : pairs) {
        if (patch[a] != p || patch[b] != p) continue;
        if (reached.contains(a)) reached.insert(b);
        if (reached.contains(b)) reached.insert(a);
      }
    }
    EXPECT_EQ(std::ssize(reached), sizes[p]) << "patch " << p;
  }
}

TEST(ClusterPatches, AreOfSimilarSize) {
  const geometry::Cells cells = LatticeCells(LimbMesh(), 0.02, Vec3::Zero());
  const auto sizes = Sizes(ClusterPatches(cells, 40, 1).value());
  const double mean = static_cast<double>(cells.size()) / 40;
  EXPECT_GT(*std::ranges::min_element(sizes), 0.3 * mean);
  EXPECT_LT(*std::ranges::max_element(sizes), 2.5 * mean);
}

TEST(ClusterPatches, NeverSpanComponents) {
  const geometry::Cells cells = LatticeCells(TwoLimbs(), 0.03, Vec3::Zero());
  const auto patch = ClusterPatches(cells, 11, 3).value();
  std::vector<std::set<std::int32_t>> components(11);
  for (std::size_t c = 0; c < cells.size(); ++c) components[patch[c]].insert(cells.component[c]);
  for (const auto& component : components) EXPECT_EQ(component.size(), 1u);
}

TEST(ClusterPatches, GiveEveryComponentOneEvenWhenFewerAreAskedFor) {
  const geometry::Cells cells = LatticeCells(TwoLimbs(), 0.03, Vec3::Zero());
  const auto components = 1 + *std::ranges::max_element(cells.component);
  EXPECT_EQ(std::ssize(Sizes(ClusterPatches(cells, 1, 1).value())), components);
}

TEST(ClusterPatches, AreTheSameForTheSameSeed) {
  const geometry::Cells cells = LatticeCells(LimbMesh(), 0.03, Vec3::Zero());
  EXPECT_EQ(ClusterPatches(cells, 20, 5).value(), ClusterPatches(cells, 20, 5).value());
}

TEST(ClusterPatches, AreNeverMoreThanCells) {
  const geometry::Cells cells = LatticeCells(LimbMesh(), 0.05, Vec3::Zero());
  const auto sizes = Sizes(ClusterPatches(cells, 100000, 1).value());
  EXPECT_EQ(sizes.size(), cells.size());
}

TEST(ClusterPatches, RefuseWhatCannotBe) {
  EXPECT_FALSE(ClusterPatches({}, 3, 1).ok());
  EXPECT_FALSE(ClusterPatches(LatticeCells(LimbMesh(), 0.05, Vec3::Zero()), 0, 1).ok());
}

}  // namespace
}  // namespace vorocast::tracking
