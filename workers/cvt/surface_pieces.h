// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "services/geometry/vector.h"
#include "workers/cvt/solid.h"
#include "workers/cvt/voronoi_diagram.h"

namespace vorocast::cvt {

/// Names a vertex of the clipped cells by what meets there, so that all who compute it agree that it is one vertex.
struct VertexKey {
  enum Kind : std::int32_t {
    kMeshVertex,     // mesh vertex
    kMeshEdge,       // mesh vertices u < v, sites i < j
    kTriangle,       // triangle, sites i < j < k
    kVoronoiVertex,  // sites i < j < k < l
  };
  Kind kind = kMeshVertex;
  std::array<std::int32_t, 4> id{-1, -1, -1, -1};
  bool operator==(const VertexKey&) const = default;
};

/// The part of one triangle that is nearest to one site: a convex polygon, counter-clockwise as the triangle.
struct SurfacePiece {
  enum Place : std::int32_t { kVertex = 0, kSide = 3, kWithin = 6 };
  struct Corner {
    std::array<double, 3> weight;       // barycentric in the triangle
    double judge_distance;              // the judge's squared distance, interpolated linearly over the triangle
    std::int32_t judge;                 // lowest of the sites that meet here; it stands for all of them in comparisons
    std::int32_t edge;                  // where the edge to the next corner lies: a plane of the cell, or −1−m on side m of the triangle
    std::int32_t place;                 // kVertex + vertex, kSide + side (from vertex m to m+1), or kWithin
    std::array<std::int32_t, 2> other;  // the sites that meet here besides the piece's own
  };
  std::vector<Corner> corners;  // [capacity]
  std::size_t size = 0;
};

/// Cuts triangles by Voronoi cells. Every decision compares squared distances of mesh vertices to sites, interpolated over the triangle,
/// ties going to the lower site; the same comparison decides the same corner for every triangle and cell that shares it.
class TriangleClipper {
 public:
  TriangleClipper(const Solid& solid, const std::vector<geometry::Vec3>& sites, const VoronoiDiagram& diagram)
      : solid_(solid), sites_(sites), diagram_(diagram) {}

  /// The part of triangle `triangle` in the cell of `site`; no corner when they do not meet. False on a numerical contradiction.
  bool Clip(std::int32_t triangle, std::int32_t site, SurfacePiece* piece);

  /// Of a corner of the last piece.
  geometry::Vec3 Position(const SurfacePiece::Corner& corner) const;
  VertexKey Key(const SurfacePiece::Corner& corner) const;

 private:
  struct Bisector {
    std::int32_t name;
    std::array<double, 3> distance;  // of the triangle's vertices to the neighbour, squared
  };
  bool CutBy(std::int32_t plane, const Bisector& bisector, SurfacePiece* piece);
  /// Where the polygon's edge `edge` meets the bisector.
  SurfacePiece::Corner Crossing(std::int32_t edge, const Bisector& bisector) const;
  SurfacePiece::Corner CrossSide(int side, const Bisector& bisector) const;
  SurfacePiece::Corner CrossPlane(const Bisector& first, const Bisector& second) const;

  const Solid& solid_;
  const std::vector<geometry::Vec3>& sites_;
  const VoronoiDiagram& diagram_;

  // Of the call under way.
  std::int32_t triangle_ = 0;
  std::int32_t site_ = 0;
  std::array<std::int32_t, 3> vertex_{};
  std::array<double, 3> own_distance_{};
  std::vector<Bisector> bisectors_;  // [planes of the cell]; filled where the plane has cut
  std::vector<SurfacePiece::Corner> swap_;
  std::vector<std::uint8_t> kept_;
};

}  // namespace vorocast::cvt
