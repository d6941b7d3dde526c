// SPDX-License-Identifier: AGPL-3.0-or-later
#include "workers/cvt/shells.h"

#include <numeric>

namespace vorocast::cvt {
namespace {

using geometry::Vec3;

/// Union-find over vertices with path halving; the root is the smallest number, so that the result does not depend on the order of joins.
class DisjointSets {
 public:
  explicit DisjointSets(std::size_t count) : parent_(count) { std::iota(parent_.begin(), parent_.end(), 0); }
  std::int32_t Root(std::int32_t v) {
    while (Parent(v) != v) {
      Parent(v) = Parent(Parent(v));
      v = Parent(v);
    }
    return v;
  }
  void Join(std::int32_t a, std::int32_t b) {
    a = Root(a);
    b = Root(b);
    if (a < b) Parent(b) = a;
    if (b < a) Parent(a) = b;
  }

 private:
  std::int32_t& Parent(std::int32_t v) { return parent_[static_cast<std::size_t>(v)]; }
  std::vector<std::int32_t> parent_;
};

}  // namespace

Shells FindShells(const geometry::TriangleMesh& mesh) {
  DisjointSets sets(mesh.vertices.size());
  for (const auto& t : mesh.triangles) {
    sets.Join(t[0], t[1]);
    sets.Join(t[1], t[2]);
  }
  Shells shells;
  std::vector<std::int32_t> shell_of_root(mesh.vertices.size(), -1);
  for (const auto& t : mesh.triangles) {
    std::int32_t& shell = shell_of_root[static_cast<std::size_t>(sets.Root(t[0]))];
    if (shell < 0) {
      shell = shells.count++;
      shells.area.push_back(0);
      shells.volume.push_back(0);
    }
    shells.of_triangle.push_back(shell);
    const auto corner = [&](std::size_t i) -> Vec3 { return mesh.vertices[static_cast<std::size_t>(t[i])] - mesh.vertices[0]; };
    const Vec3 twice_area = (corner(1) - corner(0)).cross(corner(2) - corner(0));
    shells.area[static_cast<std::size_t>(shell)] += twice_area.norm() / 2;
    shells.volume[static_cast<std::size_t>(shell)] += corner(0).dot(twice_area) / 6;
  }
  return shells;
}

geometry::TriangleMesh KeepShells(const geometry::TriangleMesh& mesh, const Shells& shells, const std::vector<bool>& keep) {
  geometry::TriangleMesh kept;
  std::vector<std::int32_t> new_number(mesh.vertices.size(), -1);
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    if (!keep[static_cast<std::size_t>(shells.of_triangle[t])]) continue;
    kept.triangles.push_back(mesh.triangles[t]);
    for (std::int32_t v : mesh.triangles[t]) new_number[static_cast<std::size_t>(v)] = 0;
  }
  for (std::size_t v = 0; v < mesh.vertices.size(); ++v) {
    if (new_number[v] < 0) continue;
    new_number[v] = static_cast<std::int32_t>(kept.vertices.size());
    kept.vertices.push_back(mesh.vertices[v]);
    if (!mesh.colours.empty()) kept.colours.push_back(mesh.colours[v]);
  }
  for (auto& t : kept.triangles) {
    for (std::int32_t& v : t) v = new_number[static_cast<std::size_t>(v)];
  }
  return kept;
}

}  // namespace vorocast::cvt
