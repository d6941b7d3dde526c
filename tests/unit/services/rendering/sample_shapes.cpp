// SPDX-License-Identifier: AGPL-3.0-or-later
#include "tests/unit/services/rendering/sample_shapes.h"

#include <array>
#include <numbers>

namespace vorocast::rendering::testing {

using geometry::Vec3;

geometry::Cells CubeCells(std::int32_t nx, std::int32_t ny, std::int32_t nz, double side) {
  geometry::Cells cells;
  const Vec3 shift(-nx / 2.0, 0, -nz / 2.0);
  const auto inside = [&](int x, int y, int z) { return x >= 0 && y >= 0 && z >= 0 && x < nx && y < ny && z < nz; };
  const auto cell_at = [&](int x, int y, int z) { return (x * ny + y) * nz + z; };
  const auto vertex_at = [&](int x, int y, int z) { return (x * (ny + 1) + y) * (nz + 1) + z; };
  for (int x = 0; x <= nx; ++x) {
    for (int y = 0; y <= ny; ++y) {
      for (int z = 0; z <= nz; ++z) cells.vertices.push_back(side * (Vec3(x, y, z) + shift));
    }
  }
  // Corner offsets of each face, counter-clockwise from outside, and the direction of the cell behind it.
  using Corner = std::array<int, 3>;
  struct Face {
    std::array<Corner, 4> corners;
    Corner towards;
  };
  const std::array<Face, 6> faces = {{{{{{0, 0, 0}, {0, 0, 1}, {0, 1, 1}, {0, 1, 0}}}, {-1, 0, 0}},
                                      {{{{1, 0, 0}, {1, 1, 0}, {1, 1, 1}, {1, 0, 1}}}, {1, 0, 0}},
                                      {{{{0, 0, 0}, {1, 0, 0}, {1, 0, 1}, {0, 0, 1}}}, {0, -1, 0}},
                                      {{{{0, 1, 0}, {0, 1, 1}, {1, 1, 1}, {1, 1, 0}}}, {0, 1, 0}},
                                      {{{{0, 0, 0}, {0, 1, 0}, {1, 1, 0}, {1, 0, 0}}}, {0, 0, -1}},
                                      {{{{0, 0, 1}, {1, 0, 1}, {1, 1, 1}, {0, 1, 1}}}, {0, 0, 1}}}};
  cells.face_offset = {0};
  cells.vertex_offset = {0};
  for (int x = 0; x < nx; ++x) {
    for (int y = 0; y < ny; ++y) {
      for (int z = 0; z < nz; ++z) {
        cells.centroid.push_back(side * (Vec3(x + 0.5, y + 0.5, z + 0.5) + shift));
        cells.sites.push_back(cells.centroid.back());
        cells.volume.push_back(side * side * side);
        for (const Face& face : faces) {
          for (const Corner& c : face.corners) cells.vertex.push_back(vertex_at(x + c[0], y + c[1], z + c[2]));
          cells.vertex_offset.push_back(static_cast<std::int64_t>(cells.vertex.size()));
          const Corner other = {x + face.towards[0], y + face.towards[1], z + face.towards[2]};
          cells.neighbour.push_back(inside(other[0], other[1], other[2]) ? cell_at(other[0], other[1], other[2]) : -1);
        }
        cells.face_offset.push_back(static_cast<std::int64_t>(cells.neighbour.size()));
      }
    }
  }
  return cells;
}

geometry::TriangleMesh SphereMesh(double radius, std::int32_t rings) {
  geometry::TriangleMesh mesh;
  const std::int32_t around = 2 * rings;
  for (std::int32_t i = 0; i <= rings; ++i) {
    for (std::int32_t j = 0; j < around; ++j) {
      const double polar = std::numbers::pi * i / rings;
      const double angle = std::numbers::pi * j / rings;
      mesh.vertices.push_back(radius * Vec3(std::sin(polar) * std::sin(angle), std::cos(polar), std::sin(polar) * std::cos(angle)));
    }
  }
  for (std::int32_t i = 0; i < rings; ++i) {
    for (std::int32_t j = 0; j < around; ++j) {
      const std::int32_t a = i * around + j;
      const std::int32_t b = i * around + (j + 1) % around;
      mesh.triangles.push_back({a, a + around, b});
      mesh.triangles.push_back({b, a + around, b + around});
    }
  }
  return mesh;
}

}  // namespace vorocast::rendering::testing
