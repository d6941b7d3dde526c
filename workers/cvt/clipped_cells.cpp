// SPDX-License-Identifier: AGPL-3.0-or-later
#include "workers/cvt/clipped_cells.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "services/base/random.h"
#include "workers/cvt/x_rays.h"

namespace vorocast::cvt {
namespace {

using geometry::Vec3;

constexpr int kAttempts = 8;
/// A winding not yet found.
constexpr std::int32_t kUnknown = 1 << 20;
/// Volumes of the cells must add up to the solid's to this relative error; what a contradiction breaks is far larger.
constexpr double kVolumeTolerance = 1e-9;
/// Cells grow by this when they turn out to reach further than was computed.
constexpr double kReachGrowth = 1.3;

/// A plane's mark in a set of planes; several may share one, so a set says only which corners to look at.
std::uint64_t Bit(std::int32_t plane) { return std::uint64_t{1} << (plane & 63); }

std::int32_t IndexOf(std::span<const std::int32_t> names, std::int32_t name) {
  for (std::size_t p = 0; p < names.size(); ++p) {
    if (names[p] == name) return static_cast<std::int32_t>(p);
  }
  return -1;
}

}  // namespace

absl::Status ClippedCells::Evaluate(const std::vector<Vec3>& sites, ClippedComplex* complex) {
  sites_ = sites;
  complex_ = complex;
  if (Attempt()) return absl::OkStatus();
  diagram_.Forget();
  // Either the surface crosses itself, so that the winding must be looked up, or a tie must be broken.
  if (!by_rays_) {
    by_rays_ = true;
    if (Attempt()) return absl::OkStatus();
  }
  double shift = 1e-9 * solid_.Spacing(sites.size());
  for (int attempt = 0; attempt < kAttempts; ++attempt, shift *= 4) {
    diagram_.Forget();
    base::Random random(static_cast<std::uint64_t>(attempt));
    for (std::size_t i = 0; i < sites.size(); ++i) {
      for (int a = 0; a < 3; ++a) sites_[i][a] = sites[i][a] + random.Uniform(-shift, shift);
    }
    if (Attempt()) return absl::OkStatus();
  }
  return absl::InternalError(
      fmt::format("clipping {} cells at {} triangles contradicts itself even after moving the sites; some of them may coincide", sites.size(),
                  solid_.triangles.size()));
}

bool ClippedCells::Attempt() {
  const std::size_t n = sites_.size();
  moments_.assign(n, {});
  boundary_.assign(n, 0);
  crossings_.clear();
  if (complex_) *complex_ = {};
  if (!diagram_.Build(sites_, solid_.Spacing(n), neighbours_)) return false;
  if (!FindNearestSites() || !AddSurface()) return false;
  SortCrossings();
  if (!AddFaces()) return false;
  double volume = 0;
  energy_ = 0;
  for (const Moments& m : moments_) {
    volume += m.volume;
    energy_ += m.second;
  }
  if (!(std::abs(volume - solid_.volume) <= kVolumeTolerance * solid_.volume)) return false;
  if (complex_) {
    complex_->sites = sites_;
    complex_->crossings = crossings_;
    complex_->crossing_begin = crossing_begin_;
  }
  return true;
}

/// Goes to ever nearer neighbours until none is nearer; exact as long as the point lies within the last cell's reach.
std::int32_t ClippedCells::Walk(const Vec3& point, std::int32_t start) const {
  std::int32_t at = start;
  double at_squared = SquaredDistance(point, sites_[at]);
  for (;;) {
    const VoronoiDiagram::Cell& cell = diagram_.cell(at);
    const Vec3 seen = point - sites_[at];
    if (!diagram_.AnyPlaneNear(cell, seen)) return at;
    const auto planes = diagram_.planes(cell);
    const auto names = diagram_.names(cell);
    std::int32_t next = at;
    double next_squared = at_squared;
    for (std::size_t p = 0; p < planes.size(); ++p) {
      if (planes[p].p.dot(seen) < planes[p].square * VoronoiDiagram::kSafety || names[p] < 0) continue;
      const double squared = SquaredDistance(point, sites_[names[p]]);
      if (squared < next_squared || (squared == next_squared && names[p] < next)) next = names[p], next_squared = squared;
    }
    if (next == at) return at;
    at = next;
    at_squared = next_squared;
  }
}

bool ClippedCells::FindNearestSites() {
  const auto n = static_cast<std::int32_t>(sites_.size());
  const auto find = [&](std::int32_t vertex, std::int32_t hint) {
    const Vec3& point = solid_.vertices[vertex];
    std::int32_t site = hint >= 0 ? Walk(point, hint) : diagram_.grid().Nearest(point);
    if (SquaredDistance(point, sites_[site]) > diagram_.cell(site).reach * diagram_.cell(site).reach) {
      site = diagram_.grid().Nearest(point);
      const double distance = std::sqrt(SquaredDistance(point, sites_[site]));
      if (distance > diagram_.cell(site).reach && !diagram_.Enlarge(site, 1.1 * distance)) return false;
    }
    nearest_[vertex] = site;
    return true;
  };
  const bool warm = nearest_.size() == solid_.vertices.size() && std::ranges::all_of(nearest_, [&](std::int32_t s) { return s >= 0 && s < n; });
  if (!warm) nearest_.assign(solid_.vertices.size(), -1);
  if (warm) {
    for (std::size_t v = 0; v < solid_.vertices.size(); ++v) {
      if (!find(static_cast<std::int32_t>(v), nearest_[v])) return false;
    }
    return true;
  }
  for (const auto& t : solid_.triangles) {
    std::int32_t hint = std::max({nearest_[t[0]], nearest_[t[1]], nearest_[t[2]]});
    for (std::int32_t v : t) {
      if (nearest_[v] < 0 && !find(v, hint)) return false;
      hint = nearest_[v];
    }
  }
  return true;
}

bool ClippedCells::AddSurface() {
  queued_in_.assign(sites_.size(), -1);
  cuts_.Start();
  if (complex_) {
    complex_->pieces.reserve(3 * solid_.triangles.size() / 2);
    complex_->corners.reserve(2 * solid_.triangles.size());
  }
  for (std::int32_t t = 0; t < static_cast<std::int32_t>(solid_.triangles.size()); ++t) {
    const auto& [a, b, c] = solid_.triangles[t];
    const std::int32_t site = nearest_[a];
    if (nearest_[b] == site && nearest_[c] == site) {
      // Cells are convex: all of the triangle lies in the cell.
      moments_[site].AddCone(solid_.vertices[a] - sites_[site], solid_.vertices[b] - sites_[site], solid_.vertices[c] - sites_[site]);
      boundary_[site] = 1;
      if (complex_) complex_->pieces.push_back({site, t, 0, 0});
    } else if (cuts_.Cut(t, nearest_, complex_ != nullptr, &cut_)) {
      AddCut(t, cut_);
    } else if (!AddTriangle(t)) {
      return false;
    }
  }
  return true;
}

void ClippedCells::AddCut(std::int32_t triangle, const TriangleCut& cut) {
  for (std::int32_t k = 0; k < cut.piece_count; ++k) {
    const TriangleCut::Piece& piece = cut.pieces[k];
    const std::int32_t n = piece.corner_count;
    const Vec3& site = sites_[piece.site];
    boundary_[piece.site] = 1;
    std::array<Vec3, 6> from_site;
    for (std::int32_t c = 0; c < n; ++c) from_site[c] = piece.corners[c].position - site;
    Moments& sum = moments_[piece.site];
    for (std::int32_t c = 1; c + 1 < n; ++c) sum.AddCone(from_site[0], from_site[c], from_site[c + 1]);
    for (std::int32_t c = 0; c < n; ++c) {
      // The same edge bounds, the other way round, the part of the cell's face that lies in the solid.
      const std::int32_t across = piece.corners[c].across;
      if (across < 0) continue;
      const Vec3 p = (sites_[across] - site) / 2;
      sum.AddFaceEdge(p, p.squaredNorm(), from_site[c + 1 == n ? 0 : c + 1], from_site[c], 1);
    }
    if (cut.has_inner_corner) {
      crossings_.push_back({piece.site, piece.corners[n - 2].across, piece.corners[n - 1].across, triangle, from_site[n - 1]});
    }
    if (complex_) {
      complex_->pieces.push_back({piece.site, triangle, static_cast<std::int64_t>(complex_->corners.size()), n});
      complex_->corners.insert(complex_->corners.end(), piece.corners.begin(), piece.corners.begin() + n);
    }
  }
}

/// Visits the cells that the triangle meets, from those nearest to its vertices across the bisectors that cut it.
bool ClippedCells::AddTriangle(std::int32_t triangle) {
  queue_.clear();
  const auto enqueue = [&](std::int32_t site) {
    if (queued_in_[site] == triangle) return;
    queued_in_[site] = triangle;
    queue_.push_back(site);
  };
  for (std::int32_t v : solid_.triangles[triangle]) enqueue(nearest_[v]);
  for (std::size_t q = 0; q < queue_.size(); ++q) {
    if (!AddPiece(triangle, queue_[q])) return false;
    const auto names = diagram_.names(diagram_.cell(queue_[q]));
    for (std::size_t k = 0; k < piece_.size; ++k) {
      if (piece_.corners[k].edge >= 0) enqueue(names[piece_.corners[k].edge]);
    }
  }
  return true;
}

bool ClippedCells::AddPiece(std::int32_t triangle, std::int32_t site) {
  // A piece is right where the cell is, within its reach; a piece that leaves it is cut again with a larger cell.
  for (;;) {
    if (!clipper_.Clip(triangle, site, &piece_)) return false;
    double furthest = 0;
    if (positions_.size() < piece_.size) positions_.resize(2 * piece_.size);
    for (std::size_t c = 0; c < piece_.size; ++c) {
      positions_[c] = clipper_.Position(piece_.corners[c]) - sites_[site];
      furthest = std::max(furthest, positions_[c].squaredNorm());
    }
    const double reach = diagram_.cell(site).reach;
    if (furthest <= reach * reach) break;
    if (!diagram_.Enlarge(site, std::max(kReachGrowth * reach, 1.05 * std::sqrt(furthest)))) return false;
  }
  const auto& corners = piece_.corners;
  const std::size_t n = piece_.size;
  if (n == 0) return true;
  boundary_[site] = 1;
  const VoronoiDiagram::Cell& cell = diagram_.cell(site);
  const auto planes = diagram_.planes(cell);
  const auto names = diagram_.names(cell);
  Moments& sum = moments_[site];
  for (std::size_t i = 0; i < n; ++i) {
    const Vec3& here = positions_[i];
    const Vec3& there = positions_[i + 1 == n ? 0 : i + 1];
    if (i > 0 && i + 1 < n) sum.AddCone(positions_[0], here, there);
    const std::int32_t edge = corners[i].edge;
    if (edge < 0) continue;
    // The same edge bounds, the other way round, the part of the cell's face that lies in the solid.
    sum.AddFaceEdge(planes[edge].p, planes[edge].square, there, here, 1);
    const std::int32_t edge_before = corners[i == 0 ? n - 1 : i - 1].edge;
    if (edge_before >= 0) crossings_.push_back({site, names[edge_before], names[edge], triangle, here});
  }
  if (complex_) KeepPiece(triangle, site);
  return true;
}

void ClippedCells::KeepPiece(std::int32_t triangle, std::int32_t site) {
  const auto names = diagram_.names(diagram_.cell(site));
  complex_->pieces.push_back({site, triangle, static_cast<std::int64_t>(complex_->corners.size()), static_cast<std::int32_t>(piece_.size)});
  for (std::size_t k = 0; k < piece_.size; ++k) {
    const SurfacePiece::Corner& corner = piece_.corners[k];
    complex_->corners.push_back({clipper_.Position(corner), clipper_.Key(corner), corner.edge >= 0 ? names[corner.edge] : -1});
  }
}

void ClippedCells::SortCrossings() {
  crossing_begin_.assign(sites_.size() + 1, 0);
  for (const EdgeCrossing& c : crossings_) ++crossing_begin_[c.cell + 1];
  for (std::size_t i = 1; i < crossing_begin_.size(); ++i) crossing_begin_[i] += crossing_begin_[i - 1];
  std::vector<std::int64_t> next(crossing_begin_.begin(), crossing_begin_.end() - 1);
  std::vector<EdgeCrossing> sorted(crossings_.size());
  for (const EdgeCrossing& c : crossings_) sorted[next[c.cell]++] = c;
  crossings_.swap(sorted);
}

bool ClippedCells::AddFaces() {
  const auto n = static_cast<std::int32_t>(sites_.size());
  cell_winding_.assign(sites_.size(), kUnknown);
  if (complex_) complex_->winding_begin.assign(sites_.size(), -1);
  for (std::int32_t i = 0; i < n; ++i) {
    if (boundary_[i] && !AddBoundaryCell(i)) return false;
  }
  if (!FindWholeCells()) return false;
  for (std::int32_t i = 0; i < n; ++i) {
    if (!boundary_[i] && cell_winding_[i] != 0 && !AddInteriorCell(i)) return false;
  }
  return true;
}

/// Decides which of the cells that the surface does not touch lie inside: all, unless a boundary cell says otherwise of its neighbour, or the
/// cell goes on beyond its reach and a ray says so; and what holds for one holds for all that are connected without surface between.
bool ClippedCells::FindWholeCells() {
  const auto n = static_cast<std::int32_t>(sites_.size());
  bool all_inside = true;
  for (std::int32_t i = 0; i < n; ++i) {
    if (boundary_[i]) continue;
    if (cell_winding_[i] == kUnknown && diagram_.cell(i).truncated) cell_winding_[i] = WindingAt(sites_[i]);
    all_inside = all_inside && (cell_winding_[i] == 1 || cell_winding_[i] == kUnknown);
  }
  // Of two neighbours the one with the smaller reach may not know the other, so both are asked, until nothing changes.
  for (bool changed = !all_inside; changed;) {
    changed = false;
    for (std::int32_t i = 0; i < n; ++i) {
      if (boundary_[i]) continue;
      for (std::int32_t other : diagram_.names(diagram_.cell(i))) {
        if (other < 0 || boundary_[other] || cell_winding_[other] == cell_winding_[i]) continue;
        if (cell_winding_[i] != kUnknown && cell_winding_[other] != kUnknown) return false;
        cell_winding_[i] = cell_winding_[other] = std::min(cell_winding_[i], cell_winding_[other]);  // kUnknown is the largest
        changed = true;
      }
    }
  }
  for (std::int32_t& winding : cell_winding_) {
    if (winding == kUnknown) winding = 1;
  }
  return true;
}

std::int32_t ClippedCells::WindingAt(const Vec3& point) {
  if (!rays_) rays_ = std::make_unique<XRays>(solid_.vertices, solid_.triangles);
  return rays_->Winding(point);
}

bool ClippedCells::AddBoundaryCell(std::int32_t site) {
  for (;;) {
    if (!CollectExits(site) || !FindWinding(site)) return false;
    // A corner in the solid must be a true one: where the reach has made it, the cell goes on.
    const VoronoiDiagram::Cell& cell = diagram_.cell(site);
    bool complete = true;
    if (cell.truncated) {
      const auto names = diagram_.names(cell);
      const auto corners = diagram_.corners(cell);
      for (std::size_t v = 0; v < corners.size() && complete; ++v) {
        const auto& p = corners[v].plane;
        complete = winding_[v] == 0 || (names[p[0]] >= 0 && names[p[1]] >= 0 && names[p[2]] >= 0);
      }
    }
    if (complete) break;
    if (cell.reach > 8 * solid_.box.diagonal().norm() || !diagram_.Enlarge(site, kReachGrowth * cell.reach)) return false;
  }
  AddFaceEdges(site);
  if (complex_) {
    complex_->winding_begin[site] = static_cast<std::int64_t>(complex_->winding.size());
    complex_->winding.insert(complex_->winding.end(), winding_.begin(), winding_.end());
  }
  return MarkNeighbours(site);
}

/// Finds the edge of the cell that each crossing lies on. False when there is none: surface and cell disagree.
bool ClippedCells::CollectExits(std::int32_t site) {
  const VoronoiDiagram::Cell& cell = diagram_.cell(site);
  const auto names = diagram_.names(cell);
  const auto corners = diagram_.corners(cell);
  exits_.clear();
  net_.assign(3 * corners.size(), 0);
  planes_at_.resize(corners.size());
  for (std::size_t v = 0; v < corners.size(); ++v) planes_at_[v] = Bit(corners[v].plane[0]) | Bit(corners[v].plane[1]) | Bit(corners[v].plane[2]);
  for (std::int64_t c = crossing_begin_[site]; c < crossing_begin_[site + 1]; ++c) {
    const std::int32_t from = IndexOf(names, crossings_[c].from);
    const std::int32_t to = IndexOf(names, crossings_[c].to);
    if (from < 0 || to < 0) return false;
    const std::uint64_t both = Bit(from) | Bit(to);
    int ends = 0;
    for (std::size_t v = 0; v < corners.size() && ends < 2; ++v) {
      if ((planes_at_[v] & both) != both) continue;
      for (int s = 0; s < 3; ++s) {
        const std::int32_t b = corners[v].plane[(s + 1) % 3];
        const std::int32_t d = corners[v].plane[(s + 2) % 3];
        // Walked away from this corner the edge runs counter-clockwise around d.
        const int sign = d == from && b == to ? 1 : b == from && d == to ? -1 : 0;
        if (sign == 0) continue;
        net_[3 * v + s] += sign;
        if (++ends == 1) exits_.push_back({static_cast<std::int32_t>(v), s, sign, crossings_[c].position});
      }
    }
    if (ends != 2) return false;
  }
  return true;
}

/// How often the surface winds around each corner of the cell. Along an edge that changes by its crossings, which fixes all corners up to a
/// constant. Normally the winding is 0 or 1, so the constant is known as soon as one edge changes it; if none does, the volume between
/// surface and faces tells: it counts from the inside when all corners are out, and lacks the whole cell when all are in.
bool ClippedCells::FindWinding(std::int32_t site) {
  const VoronoiDiagram::Cell& cell = diagram_.cell(site);
  const auto corners = diagram_.corners(cell);
  winding_.assign(corners.size(), kUnknown);
  winding_[0] = 0;
  stack_.assign(1, 0);
  std::int32_t lowest = 0;
  std::int32_t highest = 0;
  while (!stack_.empty()) {
    const std::int32_t v = stack_.back();
    stack_.pop_back();
    for (int s = 0; s < 3; ++s) {
      const std::int32_t w = corners[v].next[s];
      const std::int32_t winding = winding_[v] - net_[3 * v + s];
      if (winding_[w] == kUnknown) {
        winding_[w] = winding;
        lowest = std::min(lowest, winding);
        highest = std::max(highest, winding);
        stack_.push_back(w);
      } else if (winding_[w] != winding) {
        return false;
      }
    }
  }
  std::int32_t first = -lowest;
  by_rays_ = by_rays_ || highest - lowest > 1;  // the surface crosses itself
  if (by_rays_) {
    first = WindingAt(sites_[site] + corners[0].position);
  } else if (highest == lowest) {
    const Moments before = moments_[site];
    AddFaceEdges(site);
    const double volume = moments_[site].volume;
    moments_[site] = before;
    // Next to nothing inside, or next to nothing outside: rounding may have given the sign.
    if (std::abs(volume) < 1e-9 * solid_.volume / static_cast<double>(sites_.size())) return false;
    first = volume < 0 ? 1 : 0;
  }
  for (std::int32_t& winding : winding_) winding += first;
  return true;
}

/// The parts of the cell's edges that lie in the solid, for both faces of each edge. With v the start of an edge and w its end,
/// the part is v→w as often as w is inside, plus v→x for every crossing x that leaves, minus v→x for every one that enters.
void ClippedCells::AddFaceEdges(std::int32_t site) {
  const VoronoiDiagram::Cell& cell = diagram_.cell(site);
  const auto planes = diagram_.planes(cell);
  const auto corners = diagram_.corners(cell);
  Moments& sum = moments_[site];
  const auto add = [&](std::size_t v, int s, const Vec3& end, double times) {
    const HalfSpace& right = planes[corners[v].plane[(s + 1) % 3]];
    const HalfSpace& left = planes[corners[v].plane[(s + 2) % 3]];
    sum.AddFaceEdge(left.p, left.square, corners[v].position, end, times);
    sum.AddFaceEdge(right.p, right.square, corners[v].position, end, -times);
  };
  for (const Exit& exit : exits_) add(exit.corner, exit.slot, exit.position, exit.sign);
  for (std::size_t v = 0; v < corners.size(); ++v) {
    for (int s = 0; s < 3; ++s) {
      const std::size_t w = corners[v].next[s];
      // The same end must serve as the start for an edge's crossings and for the edge: the first, as in CollectExits.
      if (v < w && winding_[w] != 0) add(v, s, corners[w].position, winding_[w]);
    }
  }
}

/// A cell that the surface does not touch lies wholly where the corners lie that it shares with one that is touched.
bool ClippedCells::MarkNeighbours(std::int32_t site) {
  const VoronoiDiagram::Cell& cell = diagram_.cell(site);
  const auto names = diagram_.names(cell);
  const auto corners = diagram_.corners(cell);
  for (std::size_t v = 0; v < corners.size(); ++v) {
    for (std::int32_t p : corners[v].plane) {
      const std::int32_t other = names[p];
      if (other < 0 || boundary_[other]) continue;
      if (cell_winding_[other] != kUnknown && cell_winding_[other] != winding_[v]) return false;
      cell_winding_[other] = winding_[v];
    }
  }
  return true;
}

bool ClippedCells::AddInteriorCell(std::int32_t site) {
  // Without surface in it, an inside cell ends at its true faces.
  while (diagram_.cell(site).truncated) {
    const double reach = diagram_.cell(site).reach;
    if (reach > 8 * solid_.box.diagonal().norm() || !diagram_.Enlarge(site, kReachGrowth * reach)) return false;
  }
  const VoronoiDiagram::Cell& cell = diagram_.cell(site);
  const auto planes = diagram_.planes(cell);
  const auto corners = diagram_.corners(cell);
  Moments sum;
  for (std::size_t v = 0; v < corners.size(); ++v) {
    for (int s = 0; s < 3; ++s) {
      const std::size_t w = corners[v].next[s];
      if (v > w) continue;
      const HalfSpace& right = planes[corners[v].plane[(s + 1) % 3]];
      const HalfSpace& left = planes[corners[v].plane[(s + 2) % 3]];
      sum.AddEdge(left.p, left.square, right.p, right.square, corners[v].position, corners[w].position);
    }
  }
  const double times = cell_winding_[site];
  moments_[site] = {times * sum.volume, times * sum.first, times * sum.second};
  return true;
}

}  // namespace vorocast::cvt
