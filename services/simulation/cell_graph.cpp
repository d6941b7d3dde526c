// SPDX-License-Identifier: AGPL-3.0-or-later
#include "services/simulation/cell_graph.h"

#include <algorithm>

namespace vorocast::simulation {
namespace {

using geometry::Cells;
using geometry::Vec3;

struct Face {
  double area = 0;
  Vec3 weighted_centre = Vec3::Zero();  // area times the centre
};

/// A flat polygon, as triangles from its first corner.
Face Measure(const Cells& cells, std::size_t face) {
  const auto first = static_cast<std::size_t>(cells.vertex_offset[face]);
  const auto last = static_cast<std::size_t>(cells.vertex_offset[face + 1]);
  const auto corner = [&](std::size_t i) -> const Vec3& { return cells.vertices[static_cast<std::size_t>(cells.vertex[i])]; };
  Face result;
  for (std::size_t i = first + 1; i + 1 < last; ++i) {
    const double area = 0.5 * (corner(i) - corner(first)).cross(corner(i + 1) - corner(first)).norm();
    result.area += area;
    result.weighted_centre += area / 3 * (corner(first) + corner(i) + corner(i + 1));
  }
  return result;
}

}  // namespace

std::vector<CellEdge> CellEdges(const Cells& cells) {
  std::vector<CellEdge> edges;
  for (std::size_t c = 0; c < cells.size(); ++c) {
    for (auto f = static_cast<std::size_t>(cells.face_offset[c]); f < static_cast<std::size_t>(cells.face_offset[c + 1]); ++f) {
      const std::int32_t other = cells.neighbour[f];
      if (other <= static_cast<std::int32_t>(c)) continue;
      const Face face = Measure(cells, f);
      edges.push_back({.a = static_cast<std::int32_t>(c), .b = other, .area = face.area, .face_centre = face.weighted_centre});
    }
  }
  std::ranges::stable_sort(edges, [](const CellEdge& x, const CellEdge& y) { return std::pair(x.a, x.b) < std::pair(y.a, y.b); });
  // A cell that the surface cuts into pieces may share several faces with one neighbour.
  std::vector<CellEdge> joined;
  for (const CellEdge& edge : edges) {
    if (joined.empty() || joined.back().a != edge.a || joined.back().b != edge.b) {
      joined.push_back(edge);
      continue;
    }
    joined.back().area += edge.area;
    joined.back().face_centre += edge.face_centre;
  }
  for (CellEdge& edge : joined) {
    const Vec3& a = cells.centroid[static_cast<std::size_t>(edge.a)];
    const Vec3& b = cells.centroid[static_cast<std::size_t>(edge.b)];
    edge.distance = (a - b).norm();
    edge.face_centre = edge.area > 0 ? Vec3(edge.face_centre / edge.area) : Vec3(0.5 * (a + b));
  }
  return joined;
}

}  // namespace vorocast::simulation
