// SPDX-License-Identifier: AGPL-3.0-or-later
#include "workers/cvt/triangle_tree.h"

#include <algorithm>
#include <cmath>

namespace vorocast::cvt {

using geometry::Vec3;

namespace {
constexpr std::int32_t kLeafSize = 8;
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
  std::vector<Item> items;
  items.reserve(triangles.size());
  for (const auto& t : triangles) {
    const Vec3 middle = (vertices[t[0]] + vertices[t[1]] + vertices[t[2]]) / 3;
    items.push_back({middle.cast<float>(), static_cast<std::int32_t>(items.size())});
  }
  nodes_.reserve(2 * triangles.size() / kLeafSize + 2);
  Split(0, static_cast<std::int32_t>(items.size()), items);
  order_.reserve(items.size());
  for (const Item& item : items) order_.push_back(item.triangle);
}

/// Halves the triangles along the longest side of their middles' box. Returns the node's number.
std::int32_t TriangleTree::Split(std::int32_t begin, std::int32_t end, std::vector<Item>& items) {
  const auto at = static_cast<std::int32_t>(nodes_.size());
  nodes_.push_back({{}, begin, end, 0});
  if (end - begin <= kLeafSize) {
    geometry::Box3 box;
    for (std::int32_t i = begin; i < end; ++i) {
      for (std::int32_t v : triangles_[items[i].triangle]) box.extend(vertices_[v]);
    }
    nodes_[at].box = box;
    return at;
  }
  Eigen::AlignedBox3f middles;
  for (std::int32_t i = begin; i < end; ++i) middles.extend(items[i].middle);
  Eigen::Index axis = 0;
  middles.sizes().maxCoeff(&axis);
  const std::int32_t half = begin + (end - begin) / 2;
  std::nth_element(items.begin() + begin, items.begin() + half, items.begin() + end, [axis](const Item& a, const Item& b) {
    return a.middle[axis] != b.middle[axis] ? a.middle[axis] < b.middle[axis] : a.triangle < b.triangle;
  });
  const std::int32_t left = Split(begin, half, items);
  const std::int32_t right = Split(half, end, items);
  nodes_[at].right = right;
  nodes_[at].box = nodes_[left].box.merged(nodes_[right].box);
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
