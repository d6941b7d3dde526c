// SPDX-License-Identifier: AGPL-3.0-or-later
#include "workers/cvt/triangle_tree.h"

#include <algorithm>
#include <cmath>
#include <numeric>

namespace vorocast::cvt {

using geometry::Vec3;

namespace {
constexpr std::int32_t kLeafSize = 6;
}  // namespace

Vec3 NearestOnTriangle(const Vec3& p, const Vec3& a, const Vec3& b, const Vec3& c) {
  const Vec3 ab = b - a;
  const Vec3 ac = c - a;
  const Vec3 ap = p - a;
  const double d1 = ab.dot(ap);
  const double d2 = ac.dot(ap);
  if (d1 <= 0 && d2 <= 0) return a;
  const Vec3 bp = p - b;
  const double d3 = ab.dot(bp);
  const double d4 = ac.dot(bp);
  if (d3 >= 0 && d4 <= d3) return b;
  const double vc = d1 * d4 - d3 * d2;
  if (vc <= 0 && d1 >= 0 && d3 <= 0) return a + d1 / (d1 - d3) * ab;
  const Vec3 cp = p - c;
  const double d5 = ab.dot(cp);
  const double d6 = ac.dot(cp);
  if (d6 >= 0 && d5 <= d6) return c;
  const double vb = d5 * d2 - d1 * d6;
  if (vb <= 0 && d2 >= 0 && d6 <= 0) return a + d2 / (d2 - d6) * ac;
  const double va = d3 * d6 - d5 * d4;
  if (va <= 0 && d4 - d3 >= 0 && d5 - d6 >= 0) return b + (d4 - d3) / ((d4 - d3) + (d5 - d6)) * (c - b);
  const double sum = va + vb + vc;
  return a + vb / sum * ab + vc / sum * ac;
}

TriangleTree::TriangleTree(const std::vector<Vec3>& vertices, const std::vector<std::array<std::int32_t, 3>>& triangles)
    : vertices_(vertices), triangles_(triangles) {
  std::vector<Vec3> middle;
  middle.reserve(triangles.size());
  for (const auto& t : triangles) middle.push_back((vertices[t[0]] + vertices[t[1]] + vertices[t[2]]) / 3);
  order_.resize(triangles.size());
  std::iota(order_.begin(), order_.end(), 0);
  nodes_.reserve(triangles.size());
  Split(0, static_cast<std::int32_t>(order_.size()), middle);
}

/// Halves the triangles along the longest side of their middles' box. Returns the node's number.
std::int32_t TriangleTree::Split(std::int32_t begin, std::int32_t end, const std::vector<Vec3>& middle) {
  const auto at = static_cast<std::int32_t>(nodes_.size());
  Node node{{}, begin, end, 0};
  geometry::Box3 middles;
  for (std::int32_t i = begin; i < end; ++i) {
    for (std::int32_t v : triangles_[order_[i]]) node.box.extend(vertices_[v]);
    middles.extend(middle[order_[i]]);
  }
  nodes_.push_back(node);
  if (end - begin <= kLeafSize) return at;
  Eigen::Index axis = 0;
  middles.sizes().maxCoeff(&axis);
  const std::int32_t half = begin + (end - begin) / 2;
  std::nth_element(order_.begin() + begin, order_.begin() + half, order_.begin() + end,
                   [&](std::int32_t a, std::int32_t b) { return middle[a][axis] != middle[b][axis] ? middle[a][axis] < middle[b][axis] : a < b; });
  Split(begin, half, middle);
  nodes_[at].right = Split(half, end, middle);
  return at;
}

double TriangleTree::SquaredDistanceTo(std::int32_t triangle, const Vec3& point) const {
  const auto& t = triangles_[triangle];
  return (point - NearestOnTriangle(point, vertices_[t[0]], vertices_[t[1]], vertices_[t[2]])).squaredNorm();
}

double TriangleTree::Distance(const Vec3& point, double at_most) const {
  struct Entry {
    std::int32_t node;
    double squared;
  };
  std::array<Entry, 96> stack;  // the tree is balanced: its depth is at most 32
  std::size_t size = 0;
  stack[size++] = {0, nodes_[0].box.squaredExteriorDistance(point)};
  double best = at_most * at_most;
  while (size > 0) {
    const Entry entry = stack[--size];
    if (entry.squared >= best) continue;
    const Node& node = nodes_[entry.node];
    if (node.right == 0) {
      for (std::int32_t i = node.begin; i < node.end; ++i) best = std::min(best, SquaredDistanceTo(order_[i], point));
      continue;
    }
    Entry near{entry.node + 1, nodes_[entry.node + 1].box.squaredExteriorDistance(point)};
    Entry far{node.right, nodes_[node.right].box.squaredExteriorDistance(point)};
    if (far.squared < near.squared) std::swap(near, far);
    stack[size++] = far;
    stack[size++] = near;
  }
  return std::sqrt(best);
}

}  // namespace vorocast::cvt
