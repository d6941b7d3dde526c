// SPDX-License-Identifier: AGPL-3.0-or-later
#include "workers/cvt/x_rays.h"

#include <algorithm>
#include <cmath>

namespace vorocast::cvt {
namespace {

using geometry::Vec3;

/// On which side of the directed line a→b the point (y, z) lies in the yz plane. The sign is computed once for the undirected edge, so
/// that the two triangles of an edge always disagree about it: a ray never slips between them, nor counts twice.
bool LeftOf(const std::vector<Vec3>& vertices, std::int32_t a, std::int32_t b, double y, double z) {
  const bool swapped = a > b;
  const Vec3& u = vertices[swapped ? b : a];
  const Vec3& v = vertices[swapped ? a : b];
  const bool left = (v.y() - u.y()) * (z - u.z()) - (v.z() - u.z()) * (y - u.y()) > 0;
  return left != swapped;
}

}  // namespace

XRays::XRays(const std::vector<Vec3>& vertices, const std::vector<std::array<std::int32_t, 3>>& triangles)
    : vertices_(vertices), triangles_(triangles) {
  geometry::Box3 box;
  for (const auto& t : triangles) {
    for (std::int32_t v : t) box.extend(vertices[v]);
  }
  const Vec3 size = box.isEmpty() ? Vec3::Zero() : Vec3(box.sizes());
  if (!box.isEmpty()) y_low_ = box.min().y(), z_low_ = box.min().z();
  // About one bucket a triangle, of nearly square shape.
  const double wanted = std::clamp(static_cast<double>(triangles.size()), 1.0, 262144.0);
  const double side = std::sqrt(std::max(size.y() * size.z(), 1e-300) / wanted);
  columns_ = static_cast<std::int32_t>(std::clamp(size.y() / side, 1.0, 2048.0));
  rows_ = static_cast<std::int32_t>(std::clamp(size.z() / side, 1.0, 2048.0));
  y_scale_ = size.y() > 0 ? columns_ / size.y() : 0;
  z_scale_ = size.z() > 0 ? rows_ / size.z() : 0;

  bucket_begin_.assign(static_cast<std::size_t>(columns_) * rows_ + 1, 0);
  const auto for_each_bucket = [&](const std::array<std::int32_t, 3>& t, auto&& visit) {
    const auto [y0, y1] = std::minmax({vertices[t[0]].y(), vertices[t[1]].y(), vertices[t[2]].y()});
    const auto [z0, z1] = std::minmax({vertices[t[0]].z(), vertices[t[1]].z(), vertices[t[2]].z()});
    for (std::int32_t r = Row(z0); r <= Row(z1); ++r) {
      for (std::int32_t c = Column(y0); c <= Column(y1); ++c) visit(static_cast<std::size_t>(r) * columns_ + c);
    }
  };
  for (const auto& t : triangles) for_each_bucket(t, [&](std::size_t b) { ++bucket_begin_[b + 1]; });
  for (std::size_t b = 1; b < bucket_begin_.size(); ++b) bucket_begin_[b] += bucket_begin_[b - 1];
  bucket_.resize(static_cast<std::size_t>(bucket_begin_.back()));
  std::vector<std::int64_t> next(bucket_begin_.begin(), bucket_begin_.end() - 1);
  for (std::size_t i = 0; i < triangles.size(); ++i) {
    for_each_bucket(triangles[i], [&](std::size_t b) { bucket_[next[b]++] = static_cast<std::int32_t>(i); });
  }
}

std::int32_t XRays::Column(double y) const { return static_cast<std::int32_t>(std::clamp((y - y_low_) * y_scale_, 0.0, columns_ - 1.0)); }

std::int32_t XRays::Row(double z) const { return static_cast<std::int32_t>(std::clamp((z - z_low_) * z_scale_, 0.0, rows_ - 1.0)); }

template <typename Visit>
void XRays::VisitCrossings(double y, double z, Visit&& visit) const {
  const std::size_t b = static_cast<std::size_t>(Row(z)) * columns_ + Column(y);
  for (std::int64_t i = bucket_begin_[b]; i < bucket_begin_[b + 1]; ++i) {
    const auto& t = triangles_[bucket_[i]];
    const bool left = LeftOf(vertices_, t[0], t[1], y, z);
    if (left != LeftOf(vertices_, t[1], t[2], y, z) || left != LeftOf(vertices_, t[2], t[0], y, z)) continue;
    const Vec3& a = vertices_[t[0]];
    const Vec3 normal = (vertices_[t[1]] - a).cross(vertices_[t[2]] - a);
    const auto [x0, x1] = std::minmax({a.x(), vertices_[t[1]].x(), vertices_[t[2]].x()});
    const double x = normal.x() != 0 ? a.x() - (normal.y() * (y - a.y()) + normal.z() * (z - a.z())) / normal.x() : a.x();
    visit(std::clamp(x, x0, x1), left);
  }
}

void XRays::Crossings(double y, double z, std::vector<double>* crossings) const {
  crossings->clear();
  VisitCrossings(y, z, [&](double x, bool) { crossings->push_back(x); });
  std::ranges::sort(*crossings);
}

bool XRays::Inside(const Vec3& point) const {
  bool inside = false;
  VisitCrossings(point.y(), point.z(), [&](double x, bool) { inside ^= x > point.x(); });
  return inside;
}

std::int32_t XRays::Winding(const Vec3& point) const {
  std::int32_t winding = 0;
  VisitCrossings(point.y(), point.z(), [&](double x, bool leaves) {
    if (x > point.x()) winding += leaves ? 1 : -1;
  });
  return winding;
}

}  // namespace vorocast::cvt
