// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <map>
#include <numbers>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "services/base/random.h"
#include "services/geometry/cells.h"
#include "services/geometry/triangle_mesh.h"
#include "workers/cvt/shape.h"

/// Solids with known volumes, and what every set of cells must satisfy.
namespace vorocast::cvt::scenes {

using geometry::TriangleMesh;
using geometry::Vec3;

/// A surface of squares on a unit grid: the boundary of the cubes for which `solid` holds, scaled and moved.
template <typename Solid>
TriangleMesh Blocks(std::array<int, 3> size, Solid&& solid, double side, const Vec3& low) {
  TriangleMesh mesh;
  std::map<std::array<int, 3>, std::int32_t> number;
  const auto vertex = [&](std::array<int, 3> at) {
    const auto [found, added] = number.try_emplace(at, static_cast<std::int32_t>(mesh.vertices.size()));
    if (added) mesh.vertices.push_back(low + side * Vec3(at[0], at[1], at[2]));
    return found->second;
  };
  const auto filled = [&](std::array<int, 3> at) {
    for (int a = 0; a < 3; ++a) {
      if (at[a] < 0 || at[a] >= size[a]) return false;
    }
    return static_cast<bool>(solid(at));
  };
  for (int z = 0; z < size[2]; ++z) {
    for (int y = 0; y < size[1]; ++y) {
      for (int x = 0; x < size[0]; ++x) {
        if (!filled({x, y, z})) continue;
        for (int a = 0; a < 3; ++a) {
          for (int up = 0; up < 2; ++up) {
            std::array<int, 3> beside{x, y, z};
            beside[a] += up ? 1 : -1;
            if (filled(beside)) continue;
            std::array<std::int32_t, 4> corner;
            for (int k = 0; k < 4; ++k) {
              std::array<int, 3> at{x, y, z};
              at[a] += up;
              at[(a + 1) % 3] += k == 1 || k == 2;
              at[(a + 2) % 3] += k >= 2;
              corner[k] = vertex(at);
            }
            if (!up) std::swap(corner[1], corner[3]);
            mesh.triangles.push_back({corner[0], corner[1], corner[2]});
            mesh.triangles.push_back({corner[0], corner[2], corner[3]});
          }
        }
      }
    }
  }
  return mesh;
}

inline TriangleMesh Box(const Vec3& low, const Vec3& high) {
  TriangleMesh mesh = Blocks(
      {1, 1, 1}, [](auto) { return true; }, 1, Vec3::Zero());
  for (Vec3& v : mesh.vertices) v = low + v.cwiseProduct(high - low);
  return mesh;
}

inline TriangleMesh LShape() {
  return Blocks(
      {4, 4, 2}, [](const std::array<int, 3>& c) { return c[0] < 2 || c[1] < 2; }, 0.1, Vec3(0.01, -0.02, 0.03));
}

/// Around the z axis; `around` and `across` quadrilaterals.
inline TriangleMesh Torus(double large, double small, int around, int across) {
  TriangleMesh mesh;
  for (int i = 0; i < around; ++i) {
    for (int j = 0; j < across; ++j) {
      const double u = 2 * std::numbers::pi * i / around;
      const double v = 2 * std::numbers::pi * j / across;
      const double r = large + small * std::cos(v);
      mesh.vertices.emplace_back(r * std::cos(u), r * std::sin(u), small * std::sin(v));
      const auto at = [&](int p, int q) { return (p % around) * across + q % across; };
      mesh.triangles.push_back({at(i, j), at(i + 1, j), at(i + 1, j + 1)});
      mesh.triangles.push_back({at(i, j), at(i + 1, j + 1), at(i, j + 1)});
    }
  }
  return mesh;
}

inline TriangleMesh Sphere(const Vec3& centre, double radius, int rows) {
  TriangleMesh mesh = Blocks(
      {rows, rows, rows}, [](auto) { return true; }, 2.0 / rows, Vec3::Constant(-1));
  for (Vec3& v : mesh.vertices) v = centre + radius * v.normalized();
  return mesh;
}

inline TriangleMesh Reversed(TriangleMesh mesh) {
  for (auto& t : mesh.triangles) std::swap(t[1], t[2]);
  return mesh;
}

inline TriangleMesh Join(TriangleMesh a, const TriangleMesh& b) {
  const auto offset = static_cast<std::int32_t>(a.vertices.size());
  a.vertices.insert(a.vertices.end(), b.vertices.begin(), b.vertices.end());
  for (const auto& t : b.triangles) a.triangles.push_back({t[0] + offset, t[1] + offset, t[2] + offset});
  return a;
}

inline Shape ShapeOf(const TriangleMesh& mesh) {
  auto shape = ShapeFromSurface(mesh, 1e-12);
  EXPECT_TRUE(shape.ok()) << shape.status();
  return shape.ok() ? *std::move(shape) : Shape{};
}

/// How often the mesh winds around a point, by the solid angle of its triangles (van Oosterom & Strackee): slow, and nothing in common with
/// what the kernels do.
inline double Winding(const std::vector<Vec3>& vertices, const std::vector<std::array<std::int32_t, 3>>& triangles, const Vec3& point) {
  double angle = 0;
  for (const auto& t : triangles) {
    const Vec3 a = vertices[t[0]] - point;
    const Vec3 b = vertices[t[1]] - point;
    const Vec3 c = vertices[t[2]] - point;
    const double la = a.norm();
    const double lb = b.norm();
    const double lc = c.norm();
    angle += 2 * std::atan2(a.dot(b.cross(c)), la * lb * lc + a.dot(b) * lc + b.dot(c) * la + c.dot(a) * lb);
  }
  return angle / (4 * std::numbers::pi);
}

/// The faces of a cell's polyhedron as triangles, fanned.
inline std::vector<std::array<std::int32_t, 3>> CellTriangles(const geometry::Cells& cells, std::size_t c) {
  std::vector<std::array<std::int32_t, 3>> triangles;
  for (std::int64_t f = cells.face_offset[c]; f < cells.face_offset[c + 1]; ++f) {
    const std::int64_t begin = cells.vertex_offset[f];
    for (std::int64_t k = begin + 1; k + 1 < cells.vertex_offset[f + 1]; ++k) {
      triangles.push_back({cells.vertex[begin], cells.vertex[k], cells.vertex[k + 1]});
    }
  }
  return triangles;
}

inline double VolumeOf(const std::vector<Vec3>& vertices, const std::vector<std::array<std::int32_t, 3>>& triangles) {
  if (triangles.empty()) return 0;
  const Vec3 origin = vertices[triangles[0][0]];
  double volume = 0;
  for (const auto& t : triangles) volume += (vertices[t[0]] - origin).dot((vertices[t[1]] - origin).cross(vertices[t[2]] - origin)) / 6;
  return volume;
}

/// Arrays of the right lengths, closed polyhedra whose volumes are the stored ones, neighbours that are mutual, of one solid and across planes.
inline void ExpectSoundCells(const geometry::Cells& cells, const Shape& shape) {
  const std::size_t n = cells.size();
  ASSERT_EQ(cells.volume.size(), n);
  ASSERT_EQ(cells.centroid.size(), n);
  ASSERT_EQ(cells.boundary.size(), n);
  ASSERT_EQ(cells.depth.size(), n);
  ASSERT_EQ(cells.component.size(), n);
  ASSERT_EQ(cells.face_offset.size(), n + 1);
  ASSERT_EQ(cells.vertex_offset.size(), cells.neighbour.size() + 1);
  double total = 0;
  std::map<std::pair<std::int32_t, std::int32_t>, double> area;
  double surface = 0;
  for (std::size_t c = 0; c < n; ++c) {
    std::map<std::pair<std::int32_t, std::int32_t>, int> edges;
    bool touches = false;
    for (std::int64_t f = cells.face_offset[c]; f < cells.face_offset[c + 1]; ++f) {
      const std::int64_t begin = cells.vertex_offset[f];
      const std::int64_t size = cells.vertex_offset[f + 1] - begin;
      ASSERT_GE(size, 3);
      Vec3 normal = Vec3::Zero();
      for (std::int64_t k = 0; k < size; ++k) {
        const std::int32_t from = cells.vertex[begin + k];
        const std::int32_t to = cells.vertex[begin + (k + 1) % size];
        ++edges[{from, to}];
        const Vec3 origin = cells.vertices[cells.vertex[begin]];
        normal += (cells.vertices[from] - origin).cross(cells.vertices[to] - origin) / 2;
      }
      const std::int32_t other = cells.neighbour[f];
      if (other < 0) {
        touches = true;
        surface += normal.norm();
        continue;
      }
      EXPECT_EQ(cells.component[other], cells.component[c]);
      area[{static_cast<std::int32_t>(c), other}] += normal.norm();
      for (std::int64_t k = 0; k < size; ++k) {
        const Vec3& v = cells.vertices[cells.vertex[begin + k]];
        EXPECT_NEAR((v - cells.sites[c]).norm(), (v - cells.sites[other]).norm(), 1e-7);
      }
    }
    for (const auto& [edge, count] : edges) {
      const auto opposite = edges.find({edge.second, edge.first});
      ASSERT_TRUE(opposite != edges.end() && opposite->second == count) << "cell " << c << " is open";
    }
    const double volume = VolumeOf(cells.vertices, CellTriangles(cells, c));
    EXPECT_NEAR(volume, cells.volume[c], 1e-9 * cells.volume[c]) << "cell " << c;
    EXPECT_GT(cells.volume[c], 0);
    EXPECT_EQ(cells.boundary[c] != 0, touches);
    total += volume;
  }
  double shape_volume = 0;
  for (double v : shape.component_volume) shape_volume += v;
  EXPECT_NEAR(total, shape_volume, 1e-9 * shape_volume);
  EXPECT_NEAR(surface, cells.surface_area, 1e-9 * cells.surface_area);
  for (const auto& [pair, a] : area) {
    const auto other = area.find({pair.second, pair.first});
    EXPECT_NEAR(a, other == area.end() ? 0 : other->second, 1e-9 * cells.surface_area);
  }
}

/// `count` points uniform in a solid, by rejection with the solid angle.
inline std::vector<Vec3> PointsInside(const TriangleMesh& mesh, std::size_t count, std::uint64_t seed) {
  geometry::Box3 box;
  for (const Vec3& v : mesh.vertices) box.extend(v);
  base::Random random(seed);
  std::vector<Vec3> points;
  while (points.size() < count) {
    const Vec3 at = box.min() + Vec3(random.Uniform(), random.Uniform(), random.Uniform()).cwiseProduct(box.sizes());
    if (Winding(mesh.vertices, mesh.triangles, at) > 0.5) points.push_back(at);
  }
  return points;
}

inline std::size_t Nearest(const std::vector<Vec3>& sites, const Vec3& point) {
  std::size_t best = 0;
  for (std::size_t i = 1; i < sites.size(); ++i) {
    if ((sites[i] - point).squaredNorm() < (sites[best] - point).squaredNorm()) best = i;
  }
  return best;
}

/// The captured actor, 1.8 m, or nothing where the captures are absent.
inline std::optional<TriangleMesh> Actor() {
  const char* folder = std::getenv("VOROCAST_DATA");
  const std::filesystem::path data = folder ? std::filesystem::path(folder) : std::filesystem::path(VOROCAST_SOURCE_DIR) / "../shared/data";
  std::ifstream file(data / "crane" / "frame_0000.ply", std::ios::binary);
  std::string line;
  std::size_t vertices = 0;
  std::size_t faces = 0;
  while (std::getline(file, line) && line != "end_header") {
    if (line.starts_with("element vertex ")) vertices = std::stoul(line.substr(15));
    if (line.starts_with("element face ")) faces = std::stoul(line.substr(13));
  }
  TriangleMesh mesh;
  for (std::size_t i = 0; i < vertices; ++i) {
    std::array<float, 3> v{};
    file.read(reinterpret_cast<char*>(v.data()), sizeof v);
    mesh.vertices.emplace_back(v[0], v[1], v[2]);
  }
  for (std::size_t i = 0; i < faces; ++i) {
    char corners = 0;
    std::array<std::int32_t, 3> t{};
    file.read(&corners, 1);
    file.read(reinterpret_cast<char*>(t.data()), sizeof t);
    mesh.triangles.push_back(t);
  }
  if (!file || faces == 0) return std::nullopt;
  return mesh;
}

}  // namespace vorocast::cvt::scenes
