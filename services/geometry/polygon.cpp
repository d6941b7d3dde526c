// SPDX-License-Identifier: AGPL-3.0-or-later
#include "services/geometry/polygon.h"

#include <algorithm>
#include <cmath>
#include <numeric>

namespace vorocast::geometry {
namespace {

struct Point2 {
  double x, y;
};

double Cross(const Point2& a, const Point2& b, const Point2& c) { return (b.x - a.x) * (c.y - a.y) - (b.y - a.y) * (c.x - a.x); }

/// Drops the axis along which the polygon is seen largest; its turn becomes counter-clockwise.
std::vector<Point2> Flatten(std::span<const Vec3> corners) {
  Vec3 area = Vec3::Zero();
  for (std::size_t i = 1; i + 1 < corners.size(); ++i) area += (corners[i] - corners[0]).cross(corners[i + 1] - corners[0]);
  int axis = 0;
  area.cwiseAbs().maxCoeff(&axis);
  const int u = (axis + 1) % 3;
  const int v = (axis + 2) % 3;
  std::vector<Point2> flat;
  flat.reserve(corners.size());
  for (const Vec3& c : corners) flat.push_back(area[axis] >= 0 ? Point2{c[u], c[v]} : Point2{c[v], c[u]});
  return flat;
}

bool IsConvex(const std::vector<Point2>& p) {
  const std::size_t n = p.size();
  for (std::size_t i = 0; i < n; ++i) {
    if (Cross(p[i], p[(i + 1) % n], p[(i + 2) % n]) < 0) return false;
  }
  return true;
}

/// True when the corner at `at` can be cut off: it turns left and no other corner lies inside.
bool IsEar(const std::vector<Point2>& p, const std::vector<std::int32_t>& loop, std::size_t at) {
  const std::size_t n = loop.size();
  const auto corner = [&](std::size_t i) -> const Point2& { return p[static_cast<std::size_t>(loop[i % n])]; };
  const Point2& a = corner(at + n - 1);
  const Point2& b = corner(at);
  const Point2& c = corner(at + 1);
  if (!(Cross(a, b, c) > 0)) return false;
  for (std::size_t i = 2; i + 1 < n; ++i) {
    const Point2& q = corner(at + i);
    if (Cross(a, b, q) >= 0 && Cross(b, c, q) >= 0 && Cross(c, a, q) >= 0) return false;
  }
  return true;
}

}  // namespace

std::vector<std::array<std::int32_t, 3>> Triangulate(std::span<const Vec3> corners) {
  std::vector<std::array<std::int32_t, 3>> triangles;
  const auto n = static_cast<std::int32_t>(corners.size());
  const std::vector<Point2> flat = Flatten(corners);
  if (n <= 3 || IsConvex(flat)) {
    for (std::int32_t i = 1; i + 1 < n; ++i) triangles.push_back({0, i, i + 1});
    return triangles;
  }
  std::vector<std::int32_t> loop(corners.size());
  std::iota(loop.begin(), loop.end(), 0);
  while (loop.size() > 3) {
    std::size_t ear = 0;
    while (ear < loop.size() && !IsEar(flat, loop, ear)) ++ear;
    // Without an ear what is left has no area worth drawing right: cut anywhere.
    if (ear == loop.size()) ear = 0;
    const std::size_t m = loop.size();
    triangles.push_back({loop[(ear + m - 1) % m], loop[ear], loop[(ear + 1) % m]});
    loop.erase(loop.begin() + static_cast<std::ptrdiff_t>(ear));
  }
  triangles.push_back({loop[0], loop[1], loop[2]});
  return triangles;
}

}  // namespace vorocast::geometry
