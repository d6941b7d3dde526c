// SPDX-License-Identifier: AGPL-3.0-or-later
// What is carried over from one evaluation to the next, and what takes short cuts, against what is computed from nothing.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <set>

#include "services/base/random.h"
#include "tests/unit/workers/cvt/cell_scenes.h"
#include "workers/cvt/clipped_cells.h"
#include "workers/cvt/moved_cell.h"
#include "workers/cvt/starts.h"
#include "workers/cvt/surface_cuts.h"

namespace vorocast::cvt {
namespace {

using geometry::Vec3;

Solid TorusSolid() { return SolidOf(scenes::ShapeOf(scenes::Torus(0.5, 0.15, 48, 24)), 0); }

std::vector<Vec3> Moved(const std::vector<Vec3>& sites, double way, std::uint64_t seed) {
  base::Random random(seed);
  std::vector<Vec3> moved = sites;
  for (Vec3& site : moved) {
    for (int a = 0; a < 3; ++a) site[a] += random.Uniform(-way, way);
  }
  return moved;
}

TEST(WarmCells, AreThoseOfAFreshEvaluation) {
  const Solid solid = TorusSolid();
  const std::vector<Vec3> start = LatticeSites(solid, 400, 1);
  const double spacing = solid.Spacing(start.size());
  ClippedCells warm(solid, Neighbours::kGrid);
  ASSERT_TRUE(warm.Evaluate(start, nullptr).ok());
  // From steps that change no neighbours to such as change most.
  std::uint64_t seed = 0;
  for (double way : {1e-6, 1e-3, 0.01, 0.05, 0.2, 0.5, 0.01}) {
    SCOPED_TRACE(way);
    const std::vector<Vec3> sites = Moved(start, way * spacing, ++seed);
    ASSERT_TRUE(warm.Evaluate(sites, nullptr).ok());
    ClippedCells fresh(solid, Neighbours::kGrid);
    ASSERT_TRUE(fresh.Evaluate(sites, nullptr).ok());
    EXPECT_NEAR(warm.energy(), fresh.energy(), 1e-12 * fresh.energy());
    for (std::size_t i = 0; i < sites.size(); ++i) {
      const Moments& a = warm.moments()[i];
      const Moments& b = fresh.moments()[i];
      EXPECT_NEAR(a.volume, b.volume, 1e-11 * spacing * spacing * spacing);
      EXPECT_NEAR((a.first - b.first).norm(), 0, 1e-11 * spacing * spacing * spacing * spacing);
      EXPECT_EQ(warm.boundary()[i], fresh.boundary()[i]);
    }
  }
}

TEST(WarmCells, HaveTheNeighboursOfAFreshDiagram) {
  const Solid solid = TorusSolid();
  const std::vector<Vec3> start = LatticeSites(solid, 500, 3);
  const double spacing = solid.Spacing(start.size());
  VoronoiDiagram warm;
  ASSERT_TRUE(warm.Build(start, spacing, Neighbours::kGrid));
  for (double way : {1e-4, 0.02, 0.1, 0.3}) {
    const std::vector<Vec3> sites = Moved(start, way * spacing, 7);
    ASSERT_TRUE(warm.Build(sites, spacing, Neighbours::kGrid));
    VoronoiDiagram fresh;
    ASSERT_TRUE(fresh.Build(sites, spacing, Neighbours::kGrid));
    for (std::int32_t i = 0; i < static_cast<std::int32_t>(sites.size()); ++i) {
      if (warm.cell(i).truncated || fresh.cell(i).truncated) continue;  // which planes of the reach remain is of no meaning
      const auto a = warm.names(warm.cell(i));
      const auto b = fresh.names(fresh.cell(i));
      EXPECT_EQ(std::set<std::int32_t>(a.begin(), a.end()), std::set<std::int32_t>(b.begin(), b.end())) << "cell " << i << " after " << way;
    }
  }
}

/// The corners of a finished ConvexCell in the form in which cells are kept.
std::vector<CellCorner> CornersOf(const ConvexCell& cell) {
  std::vector<CellCorner> corners;
  for (std::int32_t i = 0; i < cell.corner_count(); ++i) {
    CellCorner corner{cell.position(i), {}, {}};
    for (int s = 0; s < 3; ++s) {
      corner.plane[s] = static_cast<std::uint16_t>(cell.corner(i).plane[s]);
      corner.next[s] = static_cast<std::uint16_t>(cell.corner(i).next[s]);
    }
    corners.push_back(corner);
  }
  return corners;
}

TEST(MovedCell, HoldsTheGuessExactlyWhenThePlanesStillMeetAsTheyDid) {
  base::Random random(5);
  int held = 0;
  int refused = 0;
  for (int round = 0; round < 300; ++round) {
    std::vector<Vec3> neighbours;
    for (int k = 0; k < 24; ++k) neighbours.emplace_back(random.Uniform(-1, 1), random.Uniform(-1, 1), random.Uniform(-1, 1));
    const auto cut = [&](ConvexCell* cell) {
      cell->Reset(1);
      for (std::size_t k = 0; k < neighbours.size(); ++k) ASSERT_TRUE(cell->Cut(neighbours[k] / 2, static_cast<std::int32_t>(k)));
    };
    ConvexCell before;
    cut(&before);
    const double way = std::pow(10, random.Uniform(-5, -1));
    for (Vec3& p : neighbours) p += way * Vec3(random.Uniform(-1, 1), random.Uniform(-1, 1), random.Uniform(-1, 1));
    ConvexCell after;
    cut(&after);
    std::vector<HalfSpace> planes;
    for (std::int32_t p = 0; p < before.plane_count(); ++p) {
      const std::int32_t name = before.name(p);
      const Vec3 middle = name < 0 ? before.plane(p).p : Vec3(neighbours[name] / 2);
      planes.push_back({middle, middle.squaredNorm()});
    }
    const auto names_at = [](const ConvexCell& cell) {
      std::set<std::set<std::int32_t>> all;
      for (std::int32_t i = 0; i < cell.corner_count(); ++i) {
        const auto& p = cell.corner(i).plane;
        all.insert({cell.name(p[0]), cell.name(p[1]), cell.name(p[2])});
      }
      return all;
    };
    MovedCell moved;
    const bool same = names_at(before) == names_at(after);
    std::set<std::int32_t> known;
    for (std::int32_t p = 0; p < before.plane_count(); ++p) known.insert(before.name(p));
    bool found = moved.Find(planes, CornersOf(before));
    for (std::int32_t k = 0; found && k < 24; ++k) found = known.contains(k) || !moved.IsCutBy(neighbours[k] / 2);
    EXPECT_EQ(found, same);
    if (found) {
      EXPECT_NEAR(moved.RadiusSquared(), after.RadiusSquared(), 1e-9 * after.RadiusSquared());
    }
    held += found;
    refused += !found;
  }
  EXPECT_GT(held, 50);
  EXPECT_GT(refused, 50);
}

TEST(SiteGrid, FindsEverySiteWithinADistance) {
  base::Random random(9);
  std::vector<Vec3> sites;
  for (int i = 0; i < 700; ++i) sites.emplace_back(random.Uniform(0, 3), random.Uniform(0, 1), random.Uniform(0, 0.2));
  SiteGrid grid;
  grid.Build(sites, 0.11);
  for (int round = 0; round < 200; ++round) {
    const Vec3 centre(random.Uniform(-0.5, 3.5), random.Uniform(-0.5, 1.5), random.Uniform(-0.5, 0.7));
    const double radius = random.Uniform(0, 1.2);
    std::set<std::int32_t> found;
    grid.Within(centre, radius * radius, [&](const SiteGrid::Entry& entry) {
      EXPECT_EQ(entry.position, sites[entry.site]);
      EXPECT_TRUE(found.insert(entry.site).second);
    });
    std::set<std::int32_t> expected;
    for (std::size_t i = 0; i < sites.size(); ++i) {
      if (SquaredDistance(sites[i], centre) < radius * radius) expected.insert(static_cast<std::int32_t>(i));
    }
    EXPECT_EQ(found, expected);
  }
}

TEST(SurfaceCuts, AgreeWithTheClipper) {
  const Solid solid = TorusSolid();
  const std::vector<Vec3> sites = Moved(LatticeSites(solid, 250, 2), 0.2 * solid.Spacing(250), 4);
  VoronoiDiagram diagram;
  ASSERT_TRUE(diagram.Build(sites, solid.Spacing(sites.size()), Neighbours::kGrid));
  std::vector<std::int32_t> nearest;
  for (const Vec3& v : solid.vertices) {
    std::int32_t best = 0;
    for (std::size_t i = 0; i < sites.size(); ++i) {
      if (SquaredDistance(v, sites[i]) < SquaredDistance(v, sites[best])) best = static_cast<std::int32_t>(i);
    }
    nearest.push_back(best);
  }
  SurfaceCuts cuts(solid, sites, diagram);
  cuts.Start();
  TriangleClipper clipper(solid, sites, diagram);
  TriangleCut cut;
  SurfacePiece piece;
  int straddling = 0;
  int plain = 0;
  int with_inner_corner = 0;
  for (std::int32_t t = 0; t < static_cast<std::int32_t>(solid.triangles.size()); ++t) {
    const auto& [a, b, c] = solid.triangles[t];
    if (nearest[a] == nearest[b] && nearest[b] == nearest[c]) continue;
    ++straddling;
    if (!cuts.Cut(t, nearest, true, &cut)) continue;
    ++plain;
    with_inner_corner += cut.has_inner_corner;
    double area = 0;
    for (std::int32_t k = 0; k < cut.piece_count; ++k) {
      const TriangleCut::Piece& own = cut.pieces[k];
      ASSERT_TRUE(clipper.Clip(t, own.site, &piece));
      ASSERT_EQ(own.corner_count, static_cast<std::int32_t>(piece.size)) << "triangle " << t;
      for (std::size_t m = 0; m < piece.size; ++m) {
        const VertexKey key = clipper.Key(piece.corners[m]);
        const auto end = own.corners.begin() + own.corner_count;
        const auto same = std::find_if(own.corners.begin(), end, [&](const TriangleCut::Corner& corner) { return corner.key == key; });
        ASSERT_NE(same, end);
        EXPECT_NEAR((same->position - clipper.Position(piece.corners[m])).norm(), 0, 1e-13);
      }
      for (std::int32_t m = 1; m + 1 < own.corner_count; ++m) {
        area += (own.corners[m].position - own.corners[0].position).cross(own.corners[m + 1].position - own.corners[0].position).norm() / 2;
      }
    }
    const double whole = (solid.vertices[b] - solid.vertices[a]).cross(solid.vertices[c] - solid.vertices[a]).norm() / 2;
    EXPECT_NEAR(area, whole, 1e-12 * whole);
  }
  EXPECT_GT(plain, straddling / 2);
  EXPECT_GT(with_inner_corner, 20);
}

}  // namespace
}  // namespace vorocast::cvt
