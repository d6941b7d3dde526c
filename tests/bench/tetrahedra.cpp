// SPDX-License-Identifier: AGPL-3.0-or-later
#include "tests/bench/tetrahedra.h"

#include <algorithm>
#include <map>

namespace vorocast::bench {

using geometry::Cells;
using geometry::Vec3;

namespace {

// The corners of the face opposite to each corner, counter-clockwise seen from outside.
constexpr std::array<std::array<std::size_t, 3>, 4> kFaces = {{{1, 2, 3}, {0, 3, 2}, {0, 1, 3}, {0, 2, 1}}};

/// The two tetrahedra at each face, which is named by its sorted corners; −1 outside.
using FaceOwners = std::map<std::array<std::int32_t, 3>, std::array<std::int32_t, 2>>;

std::array<std::int32_t, 3> NameOf(const std::array<std::int32_t, 4>& corners, std::size_t face) {
  std::array<std::int32_t, 3> name{};
  for (std::size_t i = 0; i < 3; ++i) name[i] = corners[kFaces[face][i]];
  std::ranges::sort(name);
  return name;
}

FaceOwners OwnersOf(const Tetrahedra& mesh) {
  FaceOwners owners;
  for (std::size_t t = 0; t < mesh.tetrahedra.size(); ++t) {
    for (std::size_t face = 0; face < 4; ++face) {
      const auto [place, is_new] =
          owners.try_emplace(NameOf(mesh.tetrahedra[t], face), std::array<std::int32_t, 2>{static_cast<std::int32_t>(t), -1});
      if (!is_new) place->second[1] = static_cast<std::int32_t>(t);
    }
  }
  return owners;
}

}  // namespace

Cells CellsOf(const Tetrahedra& mesh) {
  const FaceOwners owners = OwnersOf(mesh);
  Cells cells;
  cells.vertices = mesh.vertices;
  cells.face_offset.push_back(0);
  cells.vertex_offset.push_back(0);
  for (std::size_t t = 0; t < mesh.tetrahedra.size(); ++t) {
    const auto& corners = mesh.tetrahedra[t];
    std::array<Vec3, 4> x;
    for (std::size_t i = 0; i < 4; ++i) x[i] = mesh.vertices[static_cast<std::size_t>(corners[i])];
    const Vec3 centroid = (x[0] + x[1] + x[2] + x[3]) / 4;
    const double volume = (x[1] - x[0]).dot((x[2] - x[0]).cross(x[3] - x[0])) / 6;
    bool boundary = false;
    for (std::size_t face = 0; face < 4; ++face) {
      for (const std::size_t i : kFaces[face]) cells.vertex.push_back(corners[i]);
      cells.vertex_offset.push_back(static_cast<std::int64_t>(cells.vertex.size()));
      const auto& pair = owners.at(NameOf(corners, face));
      cells.neighbour.push_back(pair[0] == static_cast<std::int32_t>(t) ? pair[1] : pair[0]);
      boundary |= cells.neighbour.back() < 0;
    }
    cells.face_offset.push_back(static_cast<std::int64_t>(cells.neighbour.size()));
    cells.sites.push_back(centroid);
    cells.centroid.push_back(centroid);
    cells.volume.push_back(volume);
    cells.boundary.push_back(boundary ? 1 : 0);
    cells.depth.push_back(0);
    cells.component.push_back(0);
    // ∫ |x − centroid|² over a tetrahedron is V/20 of its corners' squared distances to the centroid.
    for (const Vec3& corner : x) cells.energy += volume / 20 * (corner - centroid).squaredNorm();
  }
  return cells;
}

geometry::TriangleMesh SurfaceOf(const Cells& cells) {
  geometry::TriangleMesh surface;
  surface.vertices = cells.vertices;
  for (std::size_t f = 0; f < cells.neighbour.size(); ++f) {
    if (cells.neighbour[f] >= 0) continue;
    const auto first = static_cast<std::size_t>(cells.vertex_offset[f]);
    const auto last = static_cast<std::size_t>(cells.vertex_offset[f + 1]);
    for (std::size_t i = first + 1; i + 1 < last; ++i) surface.triangles.push_back({cells.vertex[first], cells.vertex[i], cells.vertex[i + 1]});
  }
  return surface;
}

}  // namespace vorocast::bench
