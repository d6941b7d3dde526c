// SPDX-License-Identifier: AGPL-3.0-or-later
#include "workers/cvt/surface_pieces.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace vorocast::cvt {
namespace {

using geometry::Vec3;
using Corner = SurfacePiece::Corner;

double Interpolate(const std::array<double, 3>& weight, const std::array<double, 3>& value) {
  return weight[0] * value[0] + weight[1] * value[1] + weight[2] * value[2];
}

/// Bisectors this little beyond the triangle are compared exactly; all others cannot cut it.
constexpr double kSafety = 1 - 1e-9;

}  // namespace

bool TriangleClipper::Clip(std::int32_t triangle, std::int32_t site, SurfacePiece* piece) {
  triangle_ = triangle;
  site_ = site;
  vertex_ = solid_.triangles[triangle];
  const VoronoiDiagram::Cell& cell = diagram_.cell(site);
  const auto planes = diagram_.planes(cell);
  const auto names = diagram_.names(cell);
  if (piece->corners.size() < planes.size() + 4) piece->corners.resize(planes.size() + 4);
  if (swap_.size() < piece->corners.size()) swap_.resize(piece->corners.size());
  piece->size = 3;
  std::array<Vec3, 3> seen;  // from the site
  for (int m = 0; m < 3; ++m) {
    const Vec3& position = solid_.vertices[vertex_[m]];
    seen[m] = position - sites_[site];
    own_distance_[m] = SquaredDistance(position, sites_[site]);
    Corner& corner = piece->corners[m];
    corner = {{0, 0, 0}, own_distance_[m], site, -1 - m, SurfacePiece::kVertex + m, {-1, -1}};
    corner.weight[m] = 1;
  }
  if (bisectors_.size() < planes.size()) bisectors_.resize(planes.size());
  for (std::int32_t p = 0; p < cell.plane_count; ++p) {
    const HalfSpace& plane = planes[p];
    const double highest = std::max({plane.p.dot(seen[0]), plane.p.dot(seen[1]), plane.p.dot(seen[2])});
    if (names[p] < 0 || highest < plane.square * kSafety) continue;
    bisectors_[p].name = names[p];
    for (int m = 0; m < 3; ++m) bisectors_[p].distance[m] = SquaredDistance(solid_.vertices[vertex_[m]], sites_[names[p]]);
    if (!CutBy(p, bisectors_[p], piece)) return false;
    if (piece->size == 0) return true;
  }
  return true;
}

bool TriangleClipper::CutBy(std::int32_t plane, const Bisector& bisector, SurfacePiece* piece) {
  // Every cut adds at most one corner, so the capacity made in Clip suffices.
  const Corner* corners = piece->corners.data();
  const std::size_t n = piece->size;
  if (kept_.size() < n) kept_.resize(2 * n);
  std::size_t kept_count = 0;
  for (std::size_t c = 0; c < n; ++c) {
    const double distance = Interpolate(corners[c].weight, bisector.distance);
    kept_[c] = corners[c].judge_distance < distance || (corners[c].judge_distance == distance && corners[c].judge < bisector.name);
    kept_count += kept_[c];
  }
  if (kept_count == n) return true;
  if (kept_count == 0) {
    piece->size = 0;
    return true;
  }
  // The corners beyond the bisector are one run of a convex polygon: first … last, both cyclic.
  std::size_t first = n;
  std::size_t runs = 0;
  for (std::size_t c = 0; c < n; ++c) {
    if (!kept_[c] && kept_[c == 0 ? n - 1 : c - 1]) first = c, ++runs;
  }
  if (runs != 1) return false;
  const std::size_t removed = n - kept_count;
  const std::size_t before = (first + n - 1) % n;
  const std::size_t last = (first + removed - 1) % n;
  const std::size_t after = (last + 1) % n;
  Corner* to = swap_.data();
  for (std::size_t c = after, k = 0; k < kept_count; c = c + 1 == n ? 0 : c + 1, ++k) *to++ = corners[c];
  *to = Crossing(corners[before].edge, bisector);
  to++->edge = plane;
  *to = Crossing(corners[last].edge, bisector);
  to->edge = corners[last].edge;
  std::swap(piece->corners, swap_);
  piece->size = kept_count + 2;
  return true;
}

Corner TriangleClipper::Crossing(std::int32_t edge, const Bisector& bisector) const {
  return edge < 0 ? CrossSide(-1 - edge, bisector) : CrossPlane(bisectors_[edge], bisector);
}

/// On a side of the triangle: computed from the side's vertices and the two sites in ascending order, hence the same for both triangles
/// of the side and for both cells.
Corner TriangleClipper::CrossSide(int side, const Bisector& bisector) const {
  int u = side;
  int v = (side + 1) % 3;
  if (vertex_[u] > vertex_[v]) std::swap(u, v);
  const bool own_first = site_ < bisector.name;
  const std::array<double, 3>& low = own_first ? own_distance_ : bisector.distance;
  const std::array<double, 3>& high = own_first ? bisector.distance : own_distance_;
  const double at_u = low[u] - high[u];
  const double at_v = low[v] - high[v];
  const double t = at_u != at_v ? std::clamp(at_u / (at_u - at_v), 0.0, 1.0) : 0.5;
  Corner corner;
  corner.weight = {0, 0, 0};
  corner.weight[u] = 1 - t;
  corner.weight[v] = t;
  corner.judge = std::min(site_, bisector.name);
  corner.judge_distance = Interpolate(corner.weight, low);
  corner.place = SurfacePiece::kSide + side;
  corner.other = {bisector.name, -1};
  return corner;
}

/// Inside the triangle, where three sites are equally near: the weights solve two linear equations, set up with the sites ascending.
Corner TriangleClipper::CrossPlane(const Bisector& first, const Bisector& second) const {
  std::array<std::pair<std::int32_t, const std::array<double, 3>*>, 3> site{
      {{site_, &own_distance_}, {first.name, &first.distance}, {second.name, &second.distance}}};
  std::ranges::sort(site, {}, [](const auto& s) { return s.first; });
  Vec3 a;
  Vec3 b;
  for (int m = 0; m < 3; ++m) {
    a[m] = (*site[0].second)[m] - (*site[1].second)[m];
    b[m] = (*site[0].second)[m] - (*site[2].second)[m];
  }
  Vec3 weight = a.cross(b);
  const double sum = weight.sum();
  weight = sum != 0 ? Vec3(weight / sum) : Vec3::Constant(1.0 / 3);
  Corner corner;
  corner.weight = {weight[0], weight[1], weight[2]};
  corner.judge = site[0].first;
  corner.judge_distance = Interpolate(corner.weight, *site[0].second);
  corner.place = SurfacePiece::kWithin;
  corner.other = {first.name, second.name};
  return corner;
}

Vec3 TriangleClipper::Position(const Corner& corner) const {
  if (corner.place < SurfacePiece::kSide) return solid_.vertices[vertex_[corner.place]];
  if (corner.place < SurfacePiece::kWithin) {
    int u = corner.place - SurfacePiece::kSide;
    int v = (u + 1) % 3;
    if (vertex_[u] > vertex_[v]) std::swap(u, v);
    const Vec3& from = solid_.vertices[vertex_[u]];
    return from + corner.weight[v] * (solid_.vertices[vertex_[v]] - from);
  }
  const Vec3& origin = solid_.vertices[vertex_[0]];
  return origin + corner.weight[1] * (solid_.vertices[vertex_[1]] - origin) + corner.weight[2] * (solid_.vertices[vertex_[2]] - origin);
}

VertexKey TriangleClipper::Key(const Corner& corner) const {
  if (corner.place < SurfacePiece::kSide) return {VertexKey::kMeshVertex, {vertex_[corner.place], -1, -1, -1}};
  if (corner.place < SurfacePiece::kWithin) {
    const auto [u, v] = std::minmax({vertex_[corner.place - SurfacePiece::kSide], vertex_[(corner.place - SurfacePiece::kSide + 1) % 3]});
    const auto [i, j] = std::minmax({site_, corner.other[0]});
    return {VertexKey::kMeshEdge, {u, v, i, j}};
  }
  std::array<std::int32_t, 3> sites{site_, corner.other[0], corner.other[1]};
  std::ranges::sort(sites);
  return {VertexKey::kTriangle, {triangle_, sites[0], sites[1], sites[2]}};
}

}  // namespace vorocast::cvt
