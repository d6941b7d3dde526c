// SPDX-License-Identifier: AGPL-3.0-or-later
#include "workers/cvt/voronoi_diagram.h"

#include <algorithm>
#include <limits>

#include "workers/cvt/delaunay.h"

namespace vorocast::cvt {
namespace {

using geometry::Vec3;

/// Reach of a cell before anything is known about it, in spacings: a relaxed cell's corners lie within 0.8 spacings.
constexpr double kFirstReach = 1.0;
/// Side of the grid's boxes, in spacings: fewer boxes to look at against more sites in each.
constexpr double kGridSide = 1.4;

/// Of the planes that pad.
constexpr std::int32_t kNoName = std::numeric_limits<std::int32_t>::min();

}  // namespace

bool VoronoiDiagram::Build(const std::vector<Vec3>& sites, double spacing, Neighbours neighbours) {
  const bool warm = cells_.size() == sites.size();
  std::swap(cells_, last_cells_);
  std::swap(planes_, last_planes_);
  std::swap(names_, last_names_);
  std::swap(corners_, last_corners_);
  cells_.assign(sites.size(), {});
  planes_.clear();
  names_.clear();
  corners_.clear();
  planes_.reserve(18 * sites.size());
  names_.reserve(18 * sites.size());
  corners_.reserve(28 * sites.size());
  sites_ = sites;
  grid_.Build(sites_, kGridSide * spacing);
  seen_.assign(sites_.size(), -1);
  round_ = 0;
  neighbours_ = neighbours;
  if (neighbours_ == Neighbours::kTetGen) {
    auto delaunay = DelaunayNeighbours(sites_);
    // Without a tetrahedrisation (few sites, or all in a plane) the grid finds the neighbours.
    if (delaunay.ok())
      delaunay_ = *std::move(delaunay);
    else
      neighbours_ = Neighbours::kGrid;
  }
  for (std::int32_t i = 0; i < static_cast<std::int32_t>(sites_.size()); ++i) {
    double reach = kFirstReach * spacing;
    std::span<const std::int32_t> candidates;
    if (warm) {
      const Cell& last = last_cells_[i];
      if (neighbours_ == Neighbours::kGrid && Move(i, last)) continue;
      reach = std::max(reach, last.reach);
      candidates = {last_names_.data() + last.plane_begin, static_cast<std::size_t>(last.plane_count)};
    }
    if (!BuildCell(i, reach, candidates)) return false;
  }
  return true;
}

bool VoronoiDiagram::Enlarge(std::int32_t site, double reach) {
  const std::vector<std::int32_t> candidates(names(cells_[site]).begin(), names(cells_[site]).end());
  return BuildCell(site, reach, candidates);
}

/// Takes the last cell with its planes moved, cut further if need be. False, and nothing done, when its planes no longer meet as they did.
bool VoronoiDiagram::Move(std::int32_t site, const Cell& last) {
  const Vec3 centre = sites_[site];
  const HalfSpace* last_planes = last_planes_.data() + last.plane_begin;
  const std::span<const std::int32_t> last_names{last_names_.data() + last.plane_begin, static_cast<std::size_t>(last.plane_count)};
  const std::span<const Corner> last_corners{last_corners_.data() + last.corner_begin, static_cast<std::size_t>(last.corner_count)};
  ++round_;
  seen_[site] = round_;
  moved_planes_.clear();
  for (std::int32_t p = 0; p < last.plane_count; ++p) {
    const std::int32_t other = last_names[p];
    if (other < 0) {
      moved_planes_.push_back(last_planes[p]);
      continue;
    }
    seen_[other] = round_;
    const Vec3 middle = (sites_[other] - centre) / 2;
    moved_planes_.push_back({middle, middle.squaredNorm()});
  }
  if (!moved_.Find(moved_planes_, last_corners)) return false;
  bool sound = true;
  bool cut = false;
  grid_.Within(centre, 4 * moved_.RadiusSquared(), [&](const SiteGrid::Entry& entry) {
    if (seen_[entry.site] == round_ || !sound) return;
    const Vec3 middle = (entry.position - centre) / 2;
    if (!cut) {
      if (!moved_.IsCutBy(middle)) return;
      cut = true;
      work_.Resume(moved_planes_, last_names, last_corners, [&](std::int32_t i) { return moved_.position(i); });
    }
    sound = work_.Cut(middle, entry.site);
  });
  if (!sound) return false;
  if (cut) {
    if (work_.corner_count() > std::numeric_limits<std::uint16_t>::max()) return false;
    Store(site, last.reach);
    return true;
  }
  Cell cell = last;
  cell.plane_begin = static_cast<std::int64_t>(planes_.size());
  cell.corner_begin = static_cast<std::int64_t>(corners_.size());
  planes_.insert(planes_.end(), moved_planes_.begin(), moved_planes_.end());
  names_.insert(names_.end(), last_names.begin(), last_names.end());
  Pad();
  for (std::int32_t i = 0; i < last.corner_count; ++i) corners_.push_back({moved_.position(i), last_corners[i].plane, last_corners[i].next});
  cells_[site] = cell;
  return true;
}

bool VoronoiDiagram::BuildCell(std::int32_t site, double reach, std::span<const std::int32_t> candidates) {
  const Vec3 centre = sites_[site];
  work_.Reset(reach);
  bool sound = true;
  if (neighbours_ == Neighbours::kTetGen) {
    for (std::int32_t other : delaunay_[site]) sound = sound && work_.Cut((sites_[other] - centre) / 2, other);
  } else {
    // A candidate comes twice, first by name, then from the grid.
    ++round_;
    seen_[site] = round_;
    for (std::int32_t other : candidates) {
      if (other < 0) continue;
      seen_[other] = round_;
      sound = sound && work_.Cut((sites_[other] - centre) / 2, other);
    }
    sound = sound && CutByOthers(site, !candidates.empty());
  }
  if (!sound || work_.corner_count() > std::numeric_limits<std::uint16_t>::max()) return false;
  Store(site, reach);
  return true;
}

/// A bisector further away than the furthest corner cuts nothing: neighbours lie within twice that (the security radius).
bool VoronoiDiagram::CutByOthers(std::int32_t site, bool nearly_done) {
  const Vec3 centre = sites_[site];
  bool sound = true;
  const auto cut = [&](const SiteGrid::Entry& entry) {
    if (SquaredDistance(entry.position, centre) >= 4 * work_.RadiusSquared() || seen_[entry.site] == round_ || !sound) return;
    sound = work_.Cut((entry.position - centre) / 2, entry.site);
  };
  if (nearly_done)
    grid_.Within(centre, 4 * work_.RadiusSquared(), cut);
  else
    grid_.Around(
        centre, [&] { return sound ? 4 * work_.RadiusSquared() : -1.0; }, cut);
  return sound;
}

/// Fills up the planes of the cell just stored.
void VoronoiDiagram::Pad() {
  while (planes_.size() % 4 != 0) {
    planes_.push_back({Vec3::Zero(), 1});
    names_.push_back(kNoName);
  }
}

void VoronoiDiagram::Store(std::int32_t site, double reach) {
  Cell cell;
  cell.reach = reach;
  cell.plane_begin = static_cast<std::int64_t>(planes_.size());
  cell.corner_begin = static_cast<std::int64_t>(corners_.size());
  cell.corner_count = work_.corner_count();
  renumbered_.assign(work_.plane_count(), -1);
  for (std::int32_t i = 0; i < work_.corner_count(); ++i) {
    for (std::int32_t p : work_.corner(i).plane) renumbered_[p] = 0;
  }
  order_.clear();
  for (std::int32_t p = 0; p < work_.plane_count(); ++p) {
    if (renumbered_[p] == 0) order_.push_back(p);
  }
  // Near planes first: as next time's candidates they cut the most, and their faces are the largest.
  std::ranges::sort(order_, [&](std::int32_t a, std::int32_t b) {
    return work_.plane(a).square != work_.plane(b).square ? work_.plane(a).square < work_.plane(b).square : a < b;
  });
  for (std::int32_t p : order_) {
    renumbered_[p] = cell.plane_count++;
    planes_.push_back(work_.plane(p));
    names_.push_back(work_.name(p));
    cell.truncated = cell.truncated || work_.name(p) < 0;
  }
  Pad();
  for (std::int32_t i = 0; i < work_.corner_count(); ++i) {
    const ConvexCell::Corner& from = work_.corner(i);
    Corner to{work_.position(i), {}, {}};
    for (int s = 0; s < 3; ++s) {
      to.plane[s] = static_cast<std::uint16_t>(renumbered_[from.plane[s]]);
      to.next[s] = static_cast<std::uint16_t>(from.next[s]);
    }
    corners_.push_back(to);
  }
  cells_[site] = cell;
}

}  // namespace vorocast::cvt
