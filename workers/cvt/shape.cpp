// SPDX-License-Identifier: AGPL-3.0-or-later
#include "workers/cvt/shape.h"

#include <fmt/format.h>

#include <algorithm>
#include <numeric>
#include <optional>

#include "workers/cvt/x_rays.h"

namespace vorocast::cvt {
namespace {

using geometry::TriangleMesh;
using geometry::Vec3;

/// One closed sheet of the surface: outward (positive volume) or the wall of a cavity (negative).
struct Shell {
  TriangleMesh mesh;  // shares no storage; vertices are the whole surface's, so indices stay as they are
  std::vector<std::int32_t> triangles;
  double volume = 0;
};

std::int32_t Root(std::vector<std::int32_t>& parent, std::int32_t i) {
  while (parent[i] != i) i = parent[i] = parent[parent[i]];
  return i;
}

/// Shell of every triangle; triangles belong together when they share an edge. Numbered by their first triangle.
std::vector<std::int32_t> ShellOfTriangles(const TriangleMesh& surface, std::int32_t* count) {
  const auto n = static_cast<std::int32_t>(surface.triangles.size());
  struct Side {
    std::int32_t u, v, triangle;
  };
  std::vector<Side> sides;
  sides.reserve(3 * surface.triangles.size());
  for (std::int32_t i = 0; i < n; ++i) {
    const auto& t = surface.triangles[i];
    for (int m = 0; m < 3; ++m) sides.push_back({std::min(t[m], t[(m + 1) % 3]), std::max(t[m], t[(m + 1) % 3]), i});
  }
  std::ranges::sort(sides, [](const Side& a, const Side& b) { return std::tie(a.u, a.v, a.triangle) < std::tie(b.u, b.v, b.triangle); });
  std::vector<std::int32_t> parent(n);
  std::iota(parent.begin(), parent.end(), 0);
  for (std::size_t i = 1; i < sides.size(); ++i) {
    if (sides[i].u != sides[i - 1].u || sides[i].v != sides[i - 1].v) continue;
    const std::int32_t a = Root(parent, sides[i].triangle);
    const std::int32_t b = Root(parent, sides[i - 1].triangle);
    parent[std::max(a, b)] = std::min(a, b);
  }
  std::vector<std::int32_t> shell(n, -1);
  *count = 0;
  for (std::int32_t i = 0; i < n; ++i) {
    const std::int32_t root = Root(parent, i);
    shell[i] = root == i ? (*count)++ : shell[root];
  }
  return shell;
}

/// The solid that a cavity is cut out of: the smallest outward shell around it.
std::optional<std::size_t> Surrounding(const TriangleMesh& surface, const Shell& cavity, const std::vector<Shell>& outer) {
  const Vec3& point = surface.vertices[surface.triangles[cavity.triangles[0]][0]];
  std::optional<std::size_t> best;
  for (std::size_t o = 0; o < outer.size(); ++o) {
    if (best && outer[o].volume >= outer[*best].volume) continue;
    if (XRays(surface.vertices, outer[o].mesh.triangles).Inside(point)) best = o;
  }
  return best;
}

std::vector<Shell> SplitIntoShells(const TriangleMesh& surface) {
  std::int32_t count = 0;
  const std::vector<std::int32_t> shell_of = ShellOfTriangles(surface, &count);
  std::vector<Shell> shells(count);
  for (std::size_t i = 0; i < surface.triangles.size(); ++i) {
    shells[shell_of[i]].triangles.push_back(static_cast<std::int32_t>(i));
    shells[shell_of[i]].mesh.triangles.push_back(surface.triangles[i]);
  }
  for (Shell& shell : shells) {
    const Vec3 origin = surface.vertices[shell.mesh.triangles[0][0]];
    for (const auto& t : shell.mesh.triangles) {
      shell.volume += (surface.vertices[t[0]] - origin).dot((surface.vertices[t[1]] - origin).cross(surface.vertices[t[2]] - origin)) / 6;
    }
  }
  return shells;
}

}  // namespace

absl::StatusOr<Shape> ShapeFromSurface(TriangleMesh surface, double volume_min) {
  const auto vertex_count = static_cast<std::int32_t>(surface.vertices.size());
  for (std::size_t i = 0; i < surface.triangles.size(); ++i) {
    for (std::int32_t v : surface.triangles[i]) {
      if (v < 0 || v >= vertex_count) {
        return absl::InvalidArgumentError(fmt::format("triangle {} names vertex {}, but there are {} vertices", i, v, vertex_count));
      }
      if (!surface.vertices[v].allFinite()) return absl::InvalidArgumentError(fmt::format("vertex {} is not finite", v));
    }
  }
  if (surface.triangles.empty()) return absl::InvalidArgumentError("the surface has no triangle; it bounds no volume");
  if (!geometry::IsClosed(surface)) {
    return absl::InvalidArgumentError("the surface is not closed and edge-manifold, so it bounds no volume; close it, or start from points");
  }

  std::vector<Shell> outer;
  std::vector<Shell> cavities;
  for (Shell& shell : SplitIntoShells(surface)) {
    if (std::abs(shell.volume) < volume_min || shell.volume == 0) continue;
    (shell.volume > 0 ? outer : cavities).push_back(std::move(shell));
  }
  if (outer.empty()) {
    return absl::InvalidArgumentError(
        cavities.empty() ? fmt::format("no shell of the surface encloses {} m³; the shape is empty", volume_min)
                         : std::string("the surface is turned inside out: no shell encloses a positive volume; reverse its triangles"));
  }
  std::vector<double> volume;
  for (const Shell& shell : outer) volume.push_back(shell.volume);
  std::vector<std::vector<std::int32_t>> members;
  for (const Shell& shell : outer) members.push_back(shell.triangles);
  for (const Shell& cavity : cavities) {
    // The cavities of a dropped shell go with it.
    const std::optional<std::size_t> owner = Surrounding(surface, cavity, outer);
    if (!owner) continue;
    volume[*owner] += cavity.volume;
    members[*owner].insert(members[*owner].end(), cavity.triangles.begin(), cavity.triangles.end());
  }

  std::vector<std::size_t> order;
  for (std::size_t o = 0; o < outer.size(); ++o) {
    if (volume[o] > 0) order.push_back(o);
  }
  if (order.empty()) return absl::InvalidArgumentError("the surface's cavities are larger than what encloses them; its shells cross each other");
  std::ranges::stable_sort(order, [&](std::size_t a, std::size_t b) { return volume[a] > volume[b]; });

  Shape shape;
  shape.component_count = static_cast<std::int32_t>(order.size());
  std::vector<std::int32_t> component_of(surface.triangles.size(), -1);
  for (std::size_t c = 0; c < order.size(); ++c) {
    shape.component_volume.push_back(volume[order[c]]);
    for (std::int32_t t : members[order[c]]) component_of[t] = static_cast<std::int32_t>(c);
  }
  std::vector<std::int32_t> new_vertex(surface.vertices.size(), -1);
  const bool coloured = surface.colours.size() == surface.vertices.size();
  for (std::size_t i = 0; i < surface.triangles.size(); ++i) {
    if (component_of[i] < 0) continue;
    std::array<std::int32_t, 3> t = surface.triangles[i];
    for (std::int32_t& v : t) {
      if (new_vertex[v] < 0) {
        new_vertex[v] = static_cast<std::int32_t>(shape.surface.vertices.size());
        shape.surface.vertices.push_back(surface.vertices[v]);
        if (coloured) shape.surface.colours.push_back(surface.colours[v]);
      }
      v = new_vertex[v];
    }
    shape.surface.triangles.push_back(t);
    shape.triangle_component.push_back(component_of[i]);
  }
  return shape;
}

}  // namespace vorocast::cvt
