// SPDX-License-Identifier: AGPL-3.0-or-later
#include "services/geometry/triangle_mesh.h"

#include <algorithm>
#include <cmath>

#include "services/base/random.h"

namespace vorocast::geometry {
namespace {

/// Twice the triangle's area times its unit normal.
Vec3 AreaVector(const TriangleMesh& mesh, const std::array<std::int32_t, 3>& t) {
  const Vec3& a = mesh.vertices[static_cast<std::size_t>(t[0])];
  const Vec3& b = mesh.vertices[static_cast<std::size_t>(t[1])];
  const Vec3& c = mesh.vertices[static_cast<std::size_t>(t[2])];
  return (b - a).cross(c - a);
}

}  // namespace

double SignedVolume(const TriangleMesh& mesh) {
  if (mesh.vertices.empty()) return 0;
  // Relative to a vertex, so that a mesh far from the origin loses no digits.
  const Vec3 origin = mesh.vertices[0];
  double six_volumes = 0;
  for (const auto& t : mesh.triangles) six_volumes += (mesh.vertices[static_cast<std::size_t>(t[0])] - origin).dot(AreaVector(mesh, t));
  return six_volumes / 6;
}

double SurfaceArea(const TriangleMesh& mesh) {
  double twice = 0;
  for (const auto& t : mesh.triangles) twice += AreaVector(mesh, t).norm();
  return twice / 2;
}

std::vector<Vec3> VertexNormals(const TriangleMesh& mesh) {
  std::vector<Vec3> normals(mesh.vertices.size(), Vec3::Zero());
  for (const auto& t : mesh.triangles) {
    const Vec3 area = AreaVector(mesh, t);
    for (std::int32_t v : t) normals[static_cast<std::size_t>(v)] += area;
  }
  for (Vec3& n : normals) {
    const double length = n.norm();
    if (length > 0) n /= length;
  }
  return normals;
}

bool IsClosed(const TriangleMesh& mesh) {
  std::vector<std::array<std::int32_t, 2>> edges;
  edges.reserve(3 * mesh.triangles.size());
  for (const auto& t : mesh.triangles) {
    for (std::size_t i = 0; i < 3; ++i) edges.push_back({t[i], t[(i + 1) % 3]});
  }
  std::ranges::sort(edges);
  if (std::ranges::adjacent_find(edges) != edges.end()) return false;
  return std::ranges::all_of(edges, [&](const auto& e) { return std::ranges::binary_search(edges, std::array{e[1], e[0]}); });
}

OrientedPoints SampleSurface(const TriangleMesh& mesh, std::size_t count, std::uint64_t seed) {
  std::vector<double> cumulative;
  cumulative.reserve(mesh.triangles.size());
  double total = 0;
  for (const auto& t : mesh.triangles) cumulative.push_back(total += AreaVector(mesh, t).norm());
  OrientedPoints points;
  if (!(total > 0)) return points;
  base::Random random(seed);
  for (std::size_t i = 0; i < count; ++i) {
    const auto found = std::ranges::upper_bound(cumulative, random.Uniform() * total);
    const auto& t = mesh.triangles[static_cast<std::size_t>(std::min(found, cumulative.end() - 1) - cumulative.begin())];
    double u = random.Uniform();
    double v = random.Uniform();
    if (u + v > 1) u = 1 - u, v = 1 - v;
    const Vec3& a = mesh.vertices[static_cast<std::size_t>(t[0])];
    points.positions.push_back(a + u * (mesh.vertices[static_cast<std::size_t>(t[1])] - a) + v * (mesh.vertices[static_cast<std::size_t>(t[2])] - a));
    points.normals.push_back(AreaVector(mesh, t).normalized());
  }
  return points;
}

}  // namespace vorocast::geometry
