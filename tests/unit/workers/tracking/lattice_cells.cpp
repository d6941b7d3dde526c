// SPDX-License-Identifier: AGPL-3.0-or-later
#include "tests/unit/workers/tracking/lattice_cells.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>

namespace vorocast::tracking {
namespace {

using geometry::Vec3;

/// Heights z at which the vertical line through (x, y) crosses the mesh, by columns of the lattice.
std::map<std::array<int, 2>, std::vector<double>> Crossings(const geometry::TriangleMesh& mesh, double spacing, const Vec3& offset) {
  std::map<std::array<int, 2>, std::vector<double>> crossings;
  for (const auto& t : mesh.triangles) {
    const Vec3& a = mesh.vertices[t[0]];
    const Vec3& b = mesh.vertices[t[1]];
    const Vec3& c = mesh.vertices[t[2]];
    const Vec3 low = a.cwiseMin(b).cwiseMin(c);
    const Vec3 high = a.cwiseMax(b).cwiseMax(c);
    const double area = (b - a).x() * (c - a).y() - (b - a).y() * (c - a).x();
    if (area == 0) continue;
    for (int i = static_cast<int>(std::ceil((low.x() - offset.x()) / spacing)); i * spacing + offset.x() <= high.x(); ++i) {
      for (int j = static_cast<int>(std::ceil((low.y() - offset.y()) / spacing)); j * spacing + offset.y() <= high.y(); ++j) {
        const Vec3 p(i * spacing + offset.x(), j * spacing + offset.y(), 0);
        const double u = ((p - a).x() * (c - a).y() - (p - a).y() * (c - a).x()) / area;
        const double v = ((b - a).x() * (p - a).y() - (b - a).y() * (p - a).x()) / area;
        if (u >= 0 && v >= 0 && u + v < 1) crossings[{i, j}].push_back(a.z() + u * (b - a).z() + v * (c - a).z());
      }
    }
  }
  return crossings;
}

/// The cubes' faces towards their neighbours, and the mesh triangles of each cube, as compressed rows.
void AddFaces(const geometry::TriangleMesh& mesh, double spacing, const std::vector<std::vector<std::int32_t>>& triangles_of,
              const std::vector<std::array<int, 3>>& at, const std::map<std::array<int, 3>, std::int32_t>& cell_at, geometry::Cells& cells) {
  cells.vertices = mesh.vertices;
  cells.vertex_offset.push_back(0);
  cells.face_offset.push_back(0);
  for (std::size_t c = 0; c < cells.size(); ++c) {
    for (int axis = 0; axis < 3; ++axis) {
      for (const int step : {-1, 1}) {
        std::array<int, 3> beside = at[c];
        beside[axis] += step;
        const auto found = cell_at.find(beside);
        if (found == cell_at.end()) continue;
        for (const auto& [s, t] : {std::array{-1, -1}, {1, -1}, {1, 1}, {-1, 1}}) {
          Vec3 corner = Vec3::Zero();
          corner[axis] = step;
          corner[(axis + 1) % 3] = s;
          corner[(axis + 2) % 3] = step * t;
          cells.vertex.push_back(static_cast<std::int32_t>(cells.vertices.size()));
          cells.vertices.push_back(cells.sites[c] + spacing / 2 * corner);
        }
        cells.vertex_offset.push_back(static_cast<std::int64_t>(cells.vertex.size()));
        cells.neighbour.push_back(found->second);
      }
    }
    for (const std::int32_t t : triangles_of[c]) {
      for (const std::int32_t v : mesh.triangles[t]) cells.vertex.push_back(v);
      cells.vertex_offset.push_back(static_cast<std::int64_t>(cells.vertex.size()));
      cells.neighbour.push_back(-1);
    }
    cells.boundary.push_back(triangles_of[c].empty() ? 0 : 1);
    cells.face_offset.push_back(static_cast<std::int64_t>(cells.neighbour.size()));
  }
}

/// Numbers the connected parts of the lattice in order of their first cube.
void AddComponents(geometry::Cells& cells) {
  cells.component.assign(cells.size(), -1);
  const auto pairs = geometry::NeighbourPairs(cells);
  std::vector<std::vector<std::int32_t>> beside(cells.size());
  for (const auto& [a, b] : pairs) beside[a].push_back(b), beside[b].push_back(a);
  std::int32_t component = 0;
  for (std::size_t start = 0; start < cells.size(); ++start) {
    if (cells.component[start] >= 0) continue;
    std::vector<std::int32_t> queue{static_cast<std::int32_t>(start)};
    cells.component[start] = component;
    for (std::size_t i = 0; i < queue.size(); ++i) {
      for (const std::int32_t other : beside[queue[i]]) {
        if (cells.component[other] < 0) cells.component[other] = component, queue.push_back(other);
      }
    }
    ++component;
  }
}

}  // namespace

geometry::Cells LatticeCells(const geometry::TriangleMesh& mesh, double spacing_m, const Vec3& offset) {
  geometry::Cells cells;
  std::vector<std::array<int, 3>> at;
  std::map<std::array<int, 3>, std::int32_t> cell_at;
  for (auto& [column, heights] : Crossings(mesh, spacing_m, offset)) {
    std::vector<double> sorted = heights;
    std::ranges::sort(sorted);
    for (std::size_t h = 0; h + 1 < sorted.size(); h += 2) {
      for (int k = static_cast<int>(std::ceil((sorted[h] - offset.z()) / spacing_m)); k * spacing_m + offset.z() < sorted[h + 1]; ++k) {
        cell_at[{column[0], column[1], k}] = static_cast<std::int32_t>(at.size());
        at.push_back({column[0], column[1], k});
        cells.sites.push_back(offset + spacing_m * Vec3(column[0], column[1], k));
      }
    }
  }
  cells.centroid = cells.sites;
  cells.volume.assign(cells.size(), spacing_m * spacing_m * spacing_m);

  std::vector<std::vector<std::int32_t>> triangles_of(cells.size());
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    const auto& [a, b, c] = mesh.triangles[t];
    const Vec3 centre = (mesh.vertices[a] + mesh.vertices[b] + mesh.vertices[c]) / 3;
    std::size_t nearest = 0;
    for (std::size_t i = 1; i < cells.size(); ++i) {
      if ((cells.sites[i] - centre).squaredNorm() < (cells.sites[nearest] - centre).squaredNorm()) nearest = i;
    }
    triangles_of[nearest].push_back(static_cast<std::int32_t>(t));
  }
  AddFaces(mesh, spacing_m, triangles_of, at, cell_at, cells);
  AddComponents(cells);
  for (const Vec3& site : cells.sites) {
    double least = std::numeric_limits<double>::infinity();
    for (const Vec3& v : mesh.vertices) least = std::min(least, (v - site).squaredNorm());
    cells.depth.push_back(std::sqrt(least));
  }
  return cells;
}

}  // namespace vorocast::tracking
