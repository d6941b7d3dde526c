// SPDX-License-Identifier: AGPL-3.0-or-later
#include "workers/cvt/surface_cuts.h"

#include <algorithm>
#include <limits>
#include <utility>

namespace vorocast::cvt {
namespace {

using geometry::Vec3;

/// A side that passes through more cells than this is left to the clipper.
constexpr std::int32_t kPassagesMax = 3;

}  // namespace

void SurfaceCuts::Start() {
  if (sides_.empty()) NumberSides();
  ++round_;
  passages_.clear();
}

/// One number for a side of the two triangles that share it. An edge with more than two triangles just gets one number for them all.
void SurfaceCuts::NumberSides() {
  const std::size_t vertices = solid_.vertices.size();
  std::vector<std::int32_t> begin(vertices + 1, 0);
  for (const auto& t : solid_.triangles) {
    for (std::size_t m = 0; m < 3; ++m) ++begin[std::min(t[m], t[(m + 1) % 3]) + 1];
  }
  for (std::size_t v = 0; v < vertices; ++v) begin[v + 1] += begin[v];
  struct Known {
    std::int32_t high, side;
  };
  std::vector<Known> known(3 * solid_.triangles.size());
  std::vector<std::int32_t> end(begin.begin(), begin.end() - 1);
  sides_of_.resize(solid_.triangles.size());
  std::int32_t count = 0;
  for (std::size_t i = 0; i < solid_.triangles.size(); ++i) {
    const auto& t = solid_.triangles[i];
    for (std::size_t m = 0; m < 3; ++m) {
      const auto [low, high] = std::minmax(t[m], t[(m + 1) % 3]);
      std::int32_t k = begin[low];
      while (k < end[low] && known[k].high != high) ++k;
      if (k == end[low]) known[end[low]++] = {high, count++};
      sides_of_[i][m] = known[k].side;
    }
  }
  sides_.assign(count, {});
}

bool SurfaceCuts::Cut(std::int32_t triangle, const std::vector<std::int32_t>& nearest, bool with_keys, TriangleCut* cut) {
  const std::array<std::int32_t, 3>& vertex = solid_.triangles[triangle];
  // Around the triangle: its vertices, and the passages between them, each with the site behind and ahead.
  struct Stop {
    const Vec3* position;
    std::int32_t before, after;  // equal at a vertex
    std::int32_t place;          // vertex or side m
  };
  std::array<Stop, 3 + 3 * kPassagesMax> stops;
  std::array<std::int32_t, 3> passage_stops{};
  std::int32_t stop_count = 0;
  std::int32_t passage_count = 0;
  std::array<const Side*, 3> sides{};
  for (std::int32_t m = 0; m < 3; ++m) {
    const auto [low, high] = std::minmax(vertex[m], vertex[m == 2 ? 0 : m + 1]);
    if (nearest[low] == nearest[high]) continue;  // cells are convex: all of the side lies in one
    sides[m] = &Walk(sides_of_[triangle][m], low, high, nearest);
    if (sides[m]->count < 0) return false;
    passage_count += sides[m]->count;
  }
  if (passage_count > 3) return false;
  passage_count = 0;
  for (std::int32_t m = 0; m < 3; ++m) {
    const std::int32_t from = vertex[m];
    stops[stop_count++] = {&solid_.vertices[from], nearest[from], nearest[from], m};
    if (!sides[m]) continue;
    const Side& side = *sides[m];
    const bool forward = from < vertex[m == 2 ? 0 : m + 1];
    for (std::int32_t k = 0; k < side.count; ++k) {
      const Passage& p = passages_[side.begin + (forward ? k : side.count - 1 - k)];
      passage_stops[passage_count++] = stop_count;
      stops[stop_count++] = {&p.position, forward ? p.from : p.to, forward ? p.to : p.from, m};
    }
  }
  if (passage_count < 2) return false;
  Vec3 inner = Vec3::Zero();
  VertexKey inner_key;
  if (passage_count == 3) {
    std::array<std::int32_t, 3> sites{stops[passage_stops[0]].after, stops[passage_stops[1]].after, stops[passage_stops[2]].after};
    if (sites[0] == sites[1] || sites[1] == sites[2] || sites[2] == sites[0]) return false;
    inner = WithinTriangle(triangle, sites);
    const std::array<std::int32_t, 2> others{sites[1], sites[2]};
    if (!ClearlyBetween(inner, sites[0], others)) return false;
    std::ranges::sort(sites);
    inner_key = {VertexKey::kTriangle, {triangle, sites[0], sites[1], sites[2]}};
  }
  cut->piece_count = passage_count;
  cut->has_inner_corner = passage_count == 3;
  for (std::int32_t k = 0; k < passage_count; ++k) {
    TriangleCut::Piece& piece = cut->pieces[k];
    const std::int32_t first = passage_stops[k];
    const std::int32_t last = passage_stops[k + 1 == passage_count ? 0 : k + 1];
    piece.site = stops[first].after;
    piece.corner_count = 0;
    for (std::int32_t s = first;; s = s + 1 == stop_count ? 0 : s + 1) {
      const Stop& stop = stops[s];
      TriangleCut::Corner& corner = piece.corners[piece.corner_count++];
      corner.position = *stop.position;
      corner.across = -1;
      if (!with_keys) {
        corner.key = {};
      } else if (stop.before == stop.after) {
        corner.key = {VertexKey::kMeshVertex, {vertex[stop.place], -1, -1, -1}};
      } else {
        const auto [u, v] = std::minmax(vertex[stop.place], vertex[stop.place == 2 ? 0 : stop.place + 1]);
        const auto [i, j] = std::minmax(stop.before, stop.after);
        corner.key = {VertexKey::kMeshEdge, {u, v, i, j}};
      }
      if (s == last) {
        corner.across = stop.after;
        break;
      }
    }
    if (cut->has_inner_corner) piece.corners[piece.corner_count++] = {inner, inner_key, stops[first].before};
  }
  return true;
}

const SurfaceCuts::Side& SurfaceCuts::Walk(std::int32_t side, std::int32_t low, std::int32_t high, const std::vector<std::int32_t>& nearest) {
  Side& found = sides_[side];
  if (found.walked_in != round_) {
    found.walked_in = round_;
    found.begin = static_cast<std::int32_t>(passages_.size());
    found.count = FindPassages(low, high, nearest[low], nearest[high]);
  }
  return found;
}

/// Appends the passages from the cell of `first` to that of `last`; −1 when one is not clear.
std::int32_t SurfaceCuts::FindPassages(std::int32_t low, std::int32_t high, std::int32_t first, std::int32_t last) {
  // Nearly always one passage is all.
  std::int32_t at = first;
  std::int32_t before = -1;
  std::int32_t next = last;
  for (std::int32_t count = 1; count <= kPassagesMax; ++count) {
    Vec3 position = OnSide(low, high, at, next);
    if (!ClearlyBetween(position, at, {&next, 1})) {
      next = NextCell(at, before, low, high);
      if (next < 0) return -1;
      position = OnSide(low, high, at, next);
      if (!ClearlyBetween(position, at, {&next, 1})) return -1;
    }
    passages_.push_back({position, at, next});
    if (next == last) return count;
    before = at;
    at = next;
    next = last;
  }
  return -1;
}

/// The neighbour whose bisector the walk along the side meets first of those it runs towards; −1 when there is none.
std::int32_t SurfaceCuts::NextCell(std::int32_t site, std::int32_t before, std::int32_t low, std::int32_t high) const {
  const VoronoiDiagram::Cell& cell = diagram_.cell(site);
  const auto planes = diagram_.planes(cell);
  const auto names = diagram_.names(cell);
  const Vec3 start = solid_.vertices[low] - sites_[site];
  const Vec3 along = solid_.vertices[high] - solid_.vertices[low];
  std::int32_t best = -1;
  double best_way = std::numeric_limits<double>::infinity();
  for (std::size_t p = 0; p < planes.size(); ++p) {
    const double slope = planes[p].p.dot(along);
    if (!(slope > 0) || names[p] == before) continue;
    const double way = (planes[p].square - planes[p].p.dot(start)) / slope;
    if (way < best_way) best_way = way, best = names[p];
  }
  return best;
}

/// By the same operations in the same order as TriangleClipper's corner on a side, hence the same point to the last bit.
Vec3 SurfaceCuts::OnSide(std::int32_t low, std::int32_t high, std::int32_t site, std::int32_t other) const {
  const Vec3& u = solid_.vertices[low];
  const Vec3& v = solid_.vertices[high];
  const Vec3& lower = sites_[std::min(site, other)];
  const Vec3& higher = sites_[std::max(site, other)];
  const double at_u = SquaredDistance(u, lower) - SquaredDistance(u, higher);
  const double at_v = SquaredDistance(v, lower) - SquaredDistance(v, higher);
  const double t = at_u != at_v ? std::clamp(at_u / (at_u - at_v), 0.0, 1.0) : 0.5;
  return u + t * (v - u);
}

bool SurfaceCuts::ClearlyBetween(const Vec3& point, std::int32_t site, std::span<const std::int32_t> others) const {
  const VoronoiDiagram::Cell& cell = diagram_.cell(site);
  const Vec3 seen = point - sites_[site];
  // The bisectors that the point lies on count as near, so there must be exactly as many.
  const VoronoiDiagram::Hits hits = diagram_.PlanesNear(cell, seen);
  if (hits.count != static_cast<std::int64_t>(others.size())) return false;
  const auto names = diagram_.names(cell);
  const auto planes = diagram_.planes(cell);
  const double squared = seen.squaredNorm();
  for (std::int32_t other : others) {
    // The others must know their cells this far too.
    if (squared > diagram_.cell(other).reach * diagram_.cell(other).reach) return false;
    const std::size_t p = others.size() == 1 ? static_cast<std::size_t>(hits.index_sum) : std::ranges::find(names, other) - names.begin();
    if (p >= names.size() || names[p] != other || planes[p].p.dot(seen) < planes[p].square * VoronoiDiagram::kSafety) return false;
  }
  return true;
}

/// The point in the triangle's plane that is equally near to three sites: the weights solve two linear equations.
Vec3 SurfaceCuts::WithinTriangle(std::int32_t triangle, std::array<std::int32_t, 3> sites) const {
  std::ranges::sort(sites);
  const std::array<std::int32_t, 3>& t = solid_.triangles[triangle];
  Vec3 a;
  Vec3 b;
  for (int m = 0; m < 3; ++m) {
    const Vec3& vertex = solid_.vertices[t[m]];
    const double own = SquaredDistance(vertex, sites_[sites[0]]);
    a[m] = own - SquaredDistance(vertex, sites_[sites[1]]);
    b[m] = own - SquaredDistance(vertex, sites_[sites[2]]);
  }
  Vec3 weight = a.cross(b);
  const double sum = weight.sum();
  weight = sum != 0 ? Vec3(weight / sum) : Vec3::Constant(1.0 / 3);
  const Vec3& origin = solid_.vertices[t[0]];
  return origin + weight[1] * (solid_.vertices[t[1]] - origin) + weight[2] * (solid_.vertices[t[2]] - origin);
}

}  // namespace vorocast::cvt
