// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "services/geometry/vector.h"
#include "workers/cvt/solid.h"
#include "workers/cvt/surface_pieces.h"
#include "workers/cvt/voronoi_diagram.h"

namespace vorocast::cvt {

/// A triangle shared out between the two or three cells that it meets.
struct TriangleCut {
  struct Corner {
    geometry::Vec3 position;
    VertexKey key;
    std::int32_t across;  // the site across the edge to the next corner, or −1 where it lies on a side of the triangle
  };
  /// A convex polygon, counter-clockwise as the triangle. A corner within the triangle, where three cells meet, is its last one.
  struct Piece {
    std::int32_t site = 0;
    std::int32_t corner_count = 0;
    std::array<Corner, 6> corners;
  };
  std::array<Piece, 3> pieces;
  std::int32_t piece_count = 0;
  bool has_inner_corner = false;
};

/// Cuts the triangles whose cut is plain: each side passes from cell to cell at points that lie on one bisector and clearly off all others, and
/// either two cells share the triangle, or three that meet in it at a point clearly off all other bisectors. As cells are convex, such points prove
/// the whole cut, and TriangleClipper, which decides everything else, would find the same corners.
class SurfaceCuts {
 public:
  /// Keeps references to all; the solid is not to change.
  SurfaceCuts(const Solid& solid, const std::vector<geometry::Vec3>& sites, const VoronoiDiagram& diagram)
      : solid_(solid), sites_(sites), diagram_(diagram) {}

  /// Forgets what was found for other sites.
  void Start();

  /// Cuts a triangle whose vertices lie in the cells of the sites `nearest` [mesh vertices], not all in one. False when the cut is not plain. The
  /// corners' keys are left empty unless they are asked for.
  bool Cut(std::int32_t triangle, const std::vector<std::int32_t>& nearest, bool with_keys, TriangleCut* cut);

 private:
  /// Where a side leaves one cell for the next.
  struct Passage {
    geometry::Vec3 position;
    std::int32_t from, to;  // sites, walked from the side's lower vertex
  };
  struct Side {
    std::int32_t walked_in = 0;  // the round in which the rest was found
    std::int32_t begin = 0;      // of passages_
    std::int32_t count = 0;      // −1 when the side is not plain
  };

  void NumberSides();
  const Side& Walk(std::int32_t side, std::int32_t low, std::int32_t high, const std::vector<std::int32_t>& nearest);
  std::int32_t FindPassages(std::int32_t low, std::int32_t high, std::int32_t first, std::int32_t last);
  std::int32_t NextCell(std::int32_t site, std::int32_t before, std::int32_t low, std::int32_t high) const;
  geometry::Vec3 OnSide(std::int32_t low, std::int32_t high, std::int32_t site, std::int32_t other) const;
  /// Whether the point lies on the bisectors of `site` with all of `others` and clearly nearer to it than to all else.
  bool ClearlyBetween(const geometry::Vec3& point, std::int32_t site, std::span<const std::int32_t> others) const;
  geometry::Vec3 WithinTriangle(std::int32_t triangle, std::array<std::int32_t, 3> sites) const;

  const Solid& solid_;
  const std::vector<geometry::Vec3>& sites_;
  const VoronoiDiagram& diagram_;
  std::vector<std::array<std::int32_t, 3>> sides_of_;  // [triangles] by the vertex at which the side starts
  std::vector<Side> sides_;
  std::int32_t round_ = 0;
  std::vector<Passage> passages_;  // of this round
};

}  // namespace vorocast::cvt
