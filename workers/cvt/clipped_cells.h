// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "services/base/status.h"
#include "services/geometry/vector.h"
#include "workers/cvt/moments.h"
#include "workers/cvt/solid.h"
#include "workers/cvt/surface_cuts.h"
#include "workers/cvt/surface_pieces.h"
#include "workers/cvt/voronoi_diagram.h"

namespace vorocast::cvt {

/// Where the surface crosses an edge of a cell: the boundary of the solid runs on from the bisector of `from` to that of `to`. It leaves
/// the solid in the direction in which the edge runs counter-clockwise around the face of `from`.
struct EdgeCrossing {
  std::int32_t cell;
  std::int32_t from, to;  // sites
  std::int32_t triangle;
  geometry::Vec3 position;  // from the cell's site
};

/// Everything the polyhedra are assembled from, when asked for.
struct ClippedComplex {
  using Corner = TriangleCut::Corner;
  struct Piece {
    std::int32_t cell;
    std::int32_t triangle;
    std::int64_t corner_begin;
    std::int32_t corner_count;  // 0 when the piece is the whole triangle
  };
  std::vector<geometry::Vec3> sites;  // as clipped: given ones, moved by a hair if that was needed
  std::vector<Piece> pieces;          // by triangle
  std::vector<Corner> corners;
  std::vector<EdgeCrossing> crossings;       // sorted by cell
  std::vector<std::int64_t> crossing_begin;  // [n+1]
  std::vector<std::int64_t> winding_begin;   // [n] into `winding` for the cells at the surface; −1 for those wholly in or out
  std::vector<std::int32_t> winding;         // by corner of the cell in the diagram: 1 where it lies in the solid, 0 outside
};

/// The Voronoi cells of sites clipped at the surface of one solid, as moments. A surface that crosses itself is taken as it winds: what it
/// encloses twice counts twice, so that volumes still add up.
/// Keeps its work (neighbours, nearest sites) from call to
/// call: the next call with sites close to the last ones is faster, with the same result up to rounding.
class ClippedCells {
 public:
  /// Keeps a reference to the solid.
  ClippedCells(const Solid& solid, Neighbours neighbours)
      : solid_(solid), neighbours_(neighbours), clipper_(solid, sites_, diagram_), cuts_(solid, sites_, diagram_) {}
  ClippedCells(const ClippedCells&) = delete;
  ClippedCells& operator=(const ClippedCells&) = delete;

  /// Evaluates all cells; `complex` may be null. Where rounding leaves a contradiction the sites are moved by a hair (10⁻⁹ spacings) and
  /// all is done again, so the moments are those of such sites. INTERNAL when that does not help either.
  absl::Status Evaluate(const std::vector<geometry::Vec3>& sites, ClippedComplex* complex);

  /// Of the last call, one a site; about the sites as clipped.
  const std::vector<Moments>& moments() const { return moments_; }
  /// 1 where the cell touches the surface.
  const std::vector<std::uint8_t>& boundary() const { return boundary_; }
  const VoronoiDiagram& diagram() const { return diagram_; }
  double energy() const { return energy_; }
  const Solid& solid() const { return solid_; }

 private:
  bool Attempt();
  bool FindNearestSites();
  std::int32_t Walk(const geometry::Vec3& point, std::int32_t start) const;
  bool AddSurface();
  void AddCut(std::int32_t triangle, const TriangleCut& cut);
  bool AddTriangle(std::int32_t triangle);
  bool AddPiece(std::int32_t triangle, std::int32_t site);
  void KeepPiece(std::int32_t triangle, std::int32_t site);
  void SortCrossings();
  bool AddFaces();
  bool AddBoundaryCell(std::int32_t site);
  bool CollectExits(std::int32_t site);
  bool FindWinding(std::int32_t site);
  void AddFaceEdges(std::int32_t site);
  bool MarkNeighbours(std::int32_t site);
  bool FindWholeCells();
  bool AddInteriorCell(std::int32_t site);
  std::int32_t WindingAt(const geometry::Vec3& point);

  const Solid& solid_;
  Neighbours neighbours_;
  VoronoiDiagram diagram_;
  std::unique_ptr<XRays> rays_;        // made when first asked
  bool by_rays_ = false;               // ask for the winding of every cell: volumes alone have not told it
  std::vector<std::int32_t> nearest_;  // [mesh vertices]
  std::vector<Moments> moments_;
  std::vector<std::uint8_t> boundary_;
  double energy_ = 0;

  // Of the call under way.
  std::vector<geometry::Vec3> sites_;  // as clipped
  ClippedComplex* complex_ = nullptr;
  TriangleClipper clipper_;
  SurfaceCuts cuts_;
  TriangleCut cut_;
  std::vector<EdgeCrossing> crossings_;
  std::vector<std::int64_t> crossing_begin_;
  std::vector<std::int32_t> queued_in_;  // [n] the triangle whose queue last held the site
  std::vector<std::int32_t> queue_;
  SurfacePiece piece_;
  std::vector<geometry::Vec3> positions_;   // of its corners, from the site
  std::vector<std::int32_t> cell_winding_;  // [n] of cells that the surface does not touch
  struct Exit {                             // one crossing of the edge that leaves a corner by a slot: +1 leaves the solid, −1 enters it
    std::int32_t corner, slot, sign;
    geometry::Vec3 position;
  };
  std::vector<Exit> exits_;               // of the cell under way, as all below
  std::vector<std::int32_t> net_;         // [3 corners] signs summed over an edge, in the direction in which it leaves the corner
  std::vector<std::uint64_t> planes_at_;  // [corners] the set of planes that meet there
  std::vector<std::int32_t> winding_;     // [corners] how often the surface winds around: 1 inside, 0 outside
  std::vector<std::int32_t> stack_;
};

}  // namespace vorocast::cvt
