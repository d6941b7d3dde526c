// SPDX-License-Identifier: AGPL-3.0-or-later
#include "workers/cvt/solid.h"

#include <cmath>

namespace vorocast::cvt {

double Solid::Spacing(std::size_t cells) const { return std::cbrt(volume / static_cast<double>(cells)); }

Solid SolidOf(const Shape& shape, std::int32_t component) {
  Solid solid;
  std::vector<std::int32_t> new_vertex(shape.surface.vertices.size(), -1);
  for (std::size_t i = 0; i < shape.surface.triangles.size(); ++i) {
    if (shape.triangle_component[i] != component) continue;
    std::array<std::int32_t, 3> t = shape.surface.triangles[i];
    for (std::int32_t& v : t) {
      if (new_vertex[v] < 0) {
        new_vertex[v] = static_cast<std::int32_t>(solid.vertices.size());
        solid.vertices.push_back(shape.surface.vertices[v]);
        solid.box.extend(shape.surface.vertices[v]);
      }
      v = new_vertex[v];
    }
    solid.triangles.push_back(t);
  }
  for (const auto& t : solid.triangles) {
    const geometry::Vec3& origin = solid.vertices[0];
    solid.volume += (solid.vertices[t[0]] - origin).dot((solid.vertices[t[1]] - origin).cross(solid.vertices[t[2]] - origin)) / 6;
  }
  return solid;
}

}  // namespace vorocast::cvt
