// SPDX-License-Identifier: AGPL-3.0-or-later
#include "services/simulation/meshes.h"

#include <cmath>
#include <map>
#include <numbers>
#include <utility>

namespace vorocast::simulation {

using geometry::TriangleMesh;
using geometry::Vec3;

TriangleMesh BoxMesh(const Vec3& half) {
  TriangleMesh mesh;
  for (int i = 0; i < 8; ++i) mesh.vertices.emplace_back((i & 1 ? 1 : -1) * half.x(), (i & 2 ? 1 : -1) * half.y(), (i & 4 ? 1 : -1) * half.z());
  mesh.triangles = {{0, 2, 3}, {0, 3, 1}, {4, 5, 7}, {4, 7, 6}, {0, 1, 5}, {0, 5, 4},
                    {2, 6, 7}, {2, 7, 3}, {0, 4, 6}, {0, 6, 2}, {1, 3, 7}, {1, 7, 5}};
  return mesh;
}

TriangleMesh SphereMesh(double radius) {
  constexpr double kGolden = std::numbers::phi;
  TriangleMesh mesh;
  for (const double a : {-1.0, 1.0}) {
    for (const double b : {-kGolden, kGolden}) {
      mesh.vertices.emplace_back(0, a, b);
      mesh.vertices.emplace_back(a, b, 0);
      mesh.vertices.emplace_back(b, 0, a);
    }
  }
  // The icosahedron's faces are the triples of corners that are all an edge (of length 2) apart.
  const auto adjacent = [&](int i, int j) { return (mesh.vertices[i] - mesh.vertices[j]).norm() < 2.1; };
  for (int i = 0; i < 12; ++i) {
    for (int j = i + 1; j < 12; ++j) {
      for (int k = j + 1; k < 12; ++k) {
        if (!adjacent(i, j) || !adjacent(j, k) || !adjacent(i, k)) continue;
        const bool outward = mesh.vertices[i].dot(mesh.vertices[j].cross(mesh.vertices[k])) > 0;
        mesh.triangles.push_back(outward ? std::array<std::int32_t, 3>{i, j, k} : std::array<std::int32_t, 3>{i, k, j});
      }
    }
  }
  for (int level = 0; level < 2; ++level) {
    std::map<std::pair<std::int32_t, std::int32_t>, std::int32_t> middle;
    const auto between = [&](std::int32_t i, std::int32_t j) {
      const auto [found, fresh] = middle.try_emplace(std::minmax(i, j), static_cast<std::int32_t>(mesh.vertices.size()));
      if (fresh) mesh.vertices.push_back((mesh.vertices[i] + mesh.vertices[j]) / 2);
      return found->second;
    };
    std::vector<std::array<std::int32_t, 3>> finer;
    for (const auto& [i, j, k] : mesh.triangles) {
      const std::int32_t ij = between(i, j);
      const std::int32_t jk = between(j, k);
      const std::int32_t ki = between(k, i);
      finer.insert(finer.end(), {{i, ij, ki}, {ij, j, jk}, {ki, jk, k}, {ij, jk, ki}});
    }
    mesh.triangles = std::move(finer);
  }
  for (Vec3& vertex : mesh.vertices) vertex = radius * vertex.normalized();
  return mesh;
}

TriangleMesh ArmMesh(double radius, double length) {
  constexpr std::int32_t kSides = 8;
  TriangleMesh mesh;
  for (std::int32_t i = 0; i < kSides; ++i) {
    const double angle = 2 * std::numbers::pi * i / kSides;
    mesh.vertices.emplace_back(radius * std::cos(angle), 0, radius * std::sin(angle));
    mesh.vertices.emplace_back(radius * std::cos(angle), -length, radius * std::sin(angle));
  }
  for (std::int32_t i = 0; i < kSides; ++i) {
    const std::int32_t top = 2 * i;
    const std::int32_t next_top = 2 * ((i + 1) % kSides);
    mesh.triangles.push_back({top, next_top, top + 1});
    mesh.triangles.push_back({next_top, next_top + 1, top + 1});
    if (i < 2) continue;
    mesh.triangles.push_back({0, top, top - 2});
    mesh.triangles.push_back({1, top - 1, top + 1});
  }
  return mesh;
}

TriangleMesh Join(const TriangleMesh& a, const TriangleMesh& b, const Vec3& b_offset) {
  TriangleMesh joined = a;
  const auto offset = static_cast<std::int32_t>(a.vertices.size());
  for (const Vec3& vertex : b.vertices) joined.vertices.push_back(vertex + b_offset);
  for (const auto& [i, j, k] : b.triangles) joined.triangles.push_back({i + offset, j + offset, k + offset});
  return joined;
}

}  // namespace vorocast::simulation
