// SPDX-License-Identifier: AGPL-3.0-or-later
#include "workers/cvt/winding_grid.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

namespace vorocast::cvt {
namespace {

using geometry::Vec3;

/// Where the mesh crosses the grid lines along one axis.
class LineCrossings {
 public:
  LineCrossings(const geometry::TriangleMesh& mesh, const std::vector<Vec3>& corners, const GridFrame& frame, std::size_t axis)
      : axis_(axis), rows_(Nodes(frame, (axis + 1) % 3)), columns_(Nodes(frame, (axis + 2) % 3)) {
    for (const auto& t : mesh.triangles) AddTriangle(t, corners);
    std::ranges::sort(crossings_, [](const Crossing& a, const Crossing& b) { return a.line != b.line ? a.line < b.line : a.height < b.height; });
    first_.assign(rows_ * columns_ + 1, 0);
    for (const Crossing& c : crossings_) ++first_[c.line + 1];
    for (std::size_t line = 1; line < first_.size(); ++line) first_[line] += first_[line - 1];
  }

  /// The line through a node, given its coordinates along the two other axes in cyclic order.
  std::size_t Line(std::size_t row, std::size_t column) const { return row * columns_ + column; }

  /// Calls enter(height) and leave(height) in ascending order where the winding number becomes positive and stops being so.
  template <typename Visit>
  void ForEachTransition(std::size_t line, Visit&& visit) const {
    std::int32_t winding = 0;
    for (std::size_t c = first_[line]; c < first_[line + 1]; ++c) {
      const std::int32_t after = winding + crossings_[c].change;
      if ((winding > 0) != (after > 0)) visit(crossings_[c].height, after > 0);
      winding = after;
    }
  }

 private:
  struct Crossing {
    std::size_t line;
    double height;        // along the axis, in cells
    std::int32_t change;  // of the winding number, going up
  };

  static std::size_t Nodes(const GridFrame& frame, std::size_t axis) { return static_cast<std::size_t>(frame.nodes[axis]); }

  /// Twice the signed area of (p, q, x) seen along the axis, computed in the same order for both triangles of an edge, so that a line
  /// passes on the same side for both; a line through the edge counts as on the left of the edge from the lower vertex number.
  double Side(std::int32_t p, std::int32_t q, const std::vector<Vec3>& corners, double row, double column) const {
    if (p > q) return -Side(q, p, corners, row, column);
    const Vec3& a = corners[static_cast<std::size_t>(p)];
    const Vec3& b = corners[static_cast<std::size_t>(q)];
    const Eigen::Index r = static_cast<Eigen::Index>((axis_ + 1) % 3);
    const Eigen::Index c = static_cast<Eigen::Index>((axis_ + 2) % 3);
    const double side = (b[r] - a[r]) * (column - a[c]) - (b[c] - a[c]) * (row - a[r]);
    return side == 0 ? 1e-300 : side;
  }

  void AddTriangle(const std::array<std::int32_t, 3>& t, const std::vector<Vec3>& corners) {
    const auto corner = [&](std::size_t i) -> const Vec3& { return corners[static_cast<std::size_t>(t[i])]; };
    const Eigen::Index r = static_cast<Eigen::Index>((axis_ + 1) % 3);
    const Eigen::Index c = static_cast<Eigen::Index>((axis_ + 2) % 3);
    const Vec3 low = corner(0).cwiseMin(corner(1)).cwiseMin(corner(2));
    const Vec3 high = corner(0).cwiseMax(corner(1)).cwiseMax(corner(2));
    for (double row = std::ceil(low[r]); row <= high[r]; ++row) {
      for (double column = std::ceil(low[c]); column <= high[c]; ++column) {
        const double s0 = Side(t[1], t[2], corners, row, column);
        const double s1 = Side(t[2], t[0], corners, row, column);
        const double s2 = Side(t[0], t[1], corners, row, column);
        if ((s0 > 0) != (s1 > 0) || (s1 > 0) != (s2 > 0)) continue;
        const Eigen::Index a = static_cast<Eigen::Index>(axis_);
        const double height = (s0 * corner(0)[a] + s1 * corner(1)[a] + s2 * corner(2)[a]) / (s0 + s1 + s2);
        // A triangle that faces along the axis is where a line leaves.
        crossings_.push_back({Line(static_cast<std::size_t>(row), static_cast<std::size_t>(column)), height, s0 > 0 ? -1 : 1});
      }
    }
  }

  std::size_t axis_;
  std::size_t rows_;
  std::size_t columns_;
  std::vector<Crossing> crossings_;
  std::vector<std::size_t> first_;
};

/// 1 where the winding number is positive, −1 elsewhere.
ScalarGrid InsideNodes(const LineCrossings& along_k, const GridFrame& frame) {
  ScalarGrid inside{frame, std::vector<float>(frame.size(), -1)};
  for (std::int32_t i = 0; i < frame.nodes[0]; ++i) {
    for (std::int32_t j = 0; j < frame.nodes[1]; ++j) {
      float* row = &inside.value[frame.Index(i, j, 0)];
      double entered = 0;
      along_k.ForEachTransition(along_k.Line(static_cast<std::size_t>(i), static_cast<std::size_t>(j)), [&](double height, bool enters) {
        if (enters) {
          entered = height;
          return;
        }
        const std::int32_t end = std::min(static_cast<std::int32_t>(std::ceil(height)), frame.nodes[2]);
        for (std::int32_t k = std::max(0, static_cast<std::int32_t>(std::ceil(entered))); k < end; ++k) row[k] = 1;
      });
    }
  }
  return inside;
}

}  // namespace

bool IsWithoutBorder(const geometry::TriangleMesh& mesh) {
  std::vector<std::array<std::int32_t, 3>> edges;  // lower vertex, higher vertex, +1 or −1 for the direction
  edges.reserve(3 * mesh.triangles.size());
  for (const auto& t : mesh.triangles) {
    for (std::size_t i = 0; i < 3; ++i) {
      const std::int32_t a = t[i];
      const std::int32_t b = t[(i + 1) % 3];
      edges.push_back(a < b ? std::array{a, b, 1} : std::array{b, a, -1});
    }
  }
  std::ranges::sort(edges);
  std::int32_t sum = 0;
  for (std::size_t e = 0; e < edges.size(); ++e) {
    sum += edges[e][2];
    const bool last = e + 1 == edges.size() || edges[e + 1][0] != edges[e][0] || edges[e + 1][1] != edges[e][1];
    if (last && sum != 0) return false;
  }
  return true;
}

GridSurface CutWindingNumber(const geometry::TriangleMesh& mesh, const GridFrame& frame) {
  std::vector<Vec3> corners;
  corners.reserve(mesh.vertices.size());
  for (const Vec3& x : mesh.vertices) corners.emplace_back((x - frame.origin) / frame.spacing);
  const std::array<LineCrossings, 3> lines = {LineCrossings(mesh, corners, frame, 0), LineCrossings(mesh, corners, frame, 1),
                                              LineCrossings(mesh, corners, frame, 2)};
  const std::size_t nz = static_cast<std::size_t>(frame.nodes[2]);
  const std::size_t slice = static_cast<std::size_t>(frame.nodes[1]) * nz;
  return MarchingCubes(InsideNodes(lines[2], frame), [&](std::size_t axis, std::size_t node) {
    const std::array<std::size_t, 3> at = {node / slice, node % slice / nz, node % nz};
    const double start = static_cast<double>(at[axis]);
    // Without a crossing (rounding made two axes differ) the surface runs half-way.
    double fraction = 0.5;
    lines[axis].ForEachTransition(lines[axis].Line(at[(axis + 1) % 3], at[(axis + 2) % 3]), [&](double height, bool) {
      if (height >= start && height <= start + 1) fraction = height - start;
    });
    return fraction;
  });
}

}  // namespace vorocast::cvt
