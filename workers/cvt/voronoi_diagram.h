// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "services/geometry/vector.h"
#include "workers/cvt/convex_cell.h"
#include "workers/cvt/lanes.h"
#include "workers/cvt/moved_cell.h"
#include "workers/cvt/site_grid.h"
#include "workers/cvt/tessellate.h"

namespace vorocast::cvt {

/// The Voronoi cells of all sites, not clipped at any surface but each bounded to its site's surroundings (its reach): what a cell
/// looks like further away than that is not computed, and who needs it asks for a larger reach. Positions are relative to the site.
class VoronoiDiagram {
 public:
  using Corner = CellCorner;
  struct Cell {
    std::int64_t plane_begin = 0;
    std::int64_t corner_begin = 0;
    std::int32_t plane_count = 0;
    std::int32_t corner_count = 0;
    double reach = 0;        // the cell is right within this distance of its site
    bool truncated = false;  // some corner is of the reach's making
  };

  /// Cells of `sites`. Those of the last call with as many sites are the first guess, and as candidates for neighbours the second.
  /// False when rounding left a cell contradictory: move the sites by a hair.
  bool Build(const std::vector<geometry::Vec3>& sites, double spacing, Neighbours neighbours);
  /// Takes nothing from the last call.
  void Forget() { cells_.clear(); }
  /// Computes one cell again with a larger reach.
  bool Enlarge(std::int32_t site, double reach);

  const Cell& cell(std::int32_t site) const { return cells_[site]; }
  std::span<const HalfSpace> planes(const Cell& cell) const {
    return {planes_.data() + cell.plane_begin, static_cast<std::size_t>(cell.plane_count)};
  }
  /// Neighbours across the planes; negative for planes of the reach's making.
  std::span<const std::int32_t> names(const Cell& cell) const {
    return {names_.data() + cell.plane_begin, static_cast<std::size_t>(cell.plane_count)};
  }
  std::span<const Corner> corners(const Cell& cell) const {
    return {corners_.data() + cell.corner_begin, static_cast<std::size_t>(cell.corner_count)};
  }
  /// Bisectors this little beyond a point are compared exactly; all others are surely further.
  static constexpr double kSafety = 1 - 1e-9;
  /// The planes of a cell (its reach's too) that a point, seen from the site, lies beyond, on, or too near to for rounding to tell.
  struct Hits {
    std::int64_t count = 0;
    std::int64_t index_sum = 0;  // of their indices: the index, when there is one
  };
  Hits PlanesNear(const Cell& cell, const geometry::Vec3& seen) const;
  bool AnyPlaneNear(const Cell& cell, const geometry::Vec3& seen) const;

  const SiteGrid& grid() const { return grid_; }
  std::size_t size() const { return cells_.size(); }

 private:
  bool Move(std::int32_t site, const Cell& last);
  bool BuildCell(std::int32_t site, double reach, std::span<const std::int32_t> candidates);
  bool CutByOthers(std::int32_t site, bool nearly_done);
  void Pad();
  void Store(std::int32_t site, double reach);

  std::vector<geometry::Vec3> sites_;
  Neighbours neighbours_ = Neighbours::kGrid;
  SiteGrid grid_;
  ConvexCell work_;
  std::vector<std::int32_t> order_, renumbered_;  // scratch of Store
  MovedCell moved_;
  std::vector<HalfSpace> moved_planes_;
  std::vector<std::int32_t> seen_;  // [n] the round in which this one was last tried as a neighbour
  std::int32_t round_ = 0;          // a cell's

  std::vector<Cell> cells_;
  std::vector<HalfSpace> planes_;    // each cell's padded to a multiple of 4 by such as nothing lies beyond
  std::vector<std::int32_t> names_;  // as planes_
  std::vector<Corner> corners_;
  std::vector<Cell> last_cells_;
  std::vector<HalfSpace> last_planes_;
  std::vector<Corner> last_corners_;
  std::vector<std::int32_t> last_names_;
  std::vector<std::vector<std::int32_t>> delaunay_;  // with Neighbours::kTetGen
};

/// How far beyond four planes a point lies, times |p|; `point` is x, y, z and the factor of |p|² with its sign changed.
inline Lanes BeyondPlanes(const HalfSpace* planes, const Lanes& point) {
  static_assert(sizeof(HalfSpace) == 4 * sizeof(double));
  const double* at = planes->p.data();
  return SumsOf(LoadLanes(at) * point, LoadLanes(at + 4) * point, LoadLanes(at + 8) * point, LoadLanes(at + 12) * point);
}

inline VoronoiDiagram::Hits VoronoiDiagram::PlanesNear(const Cell& cell, const geometry::Vec3& seen) const {
  const Lanes point{seen.x(), seen.y(), seen.z(), -kSafety};
  LaneMask index{0, 1, 2, 3};
  LaneMask count{};
  LaneMask index_sum{};
  const HalfSpace* planes = planes_.data() + cell.plane_begin;
  for (std::int32_t p = 0; p < cell.plane_count; p += 4) {
    const LaneMask near = BeyondPlanes(planes + p, point) >= 0.0;
    count -= near;
    index_sum += near & index;
    index += 4;
  }
  return {SumOf(count), SumOf(index_sum)};
}

inline bool VoronoiDiagram::AnyPlaneNear(const Cell& cell, const geometry::Vec3& seen) const {
  const Lanes point{seen.x(), seen.y(), seen.z(), -kSafety};
  Lanes highest = Splat(-1);
  const HalfSpace* planes = planes_.data() + cell.plane_begin;
  for (std::int32_t p = 0; p < cell.plane_count; p += 4) highest = Max(highest, BeyondPlanes(planes + p, point));
  return HighestOf(highest) >= 0;
}

}  // namespace vorocast::cvt
