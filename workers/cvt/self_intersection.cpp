// SPDX-License-Identifier: AGPL-3.0-or-later
#include "workers/cvt/self_intersection.h"

#include <CGAL/Exact_predicates_inexact_constructions_kernel.h>
#include <CGAL/Polygon_mesh_processing/self_intersections.h>
#include <CGAL/Surface_mesh.h>

namespace vorocast::cvt {

bool CrossesItself(const geometry::TriangleMesh& mesh) {
  using Kernel = CGAL::Exact_predicates_inexact_constructions_kernel;
  using Mesh = CGAL::Surface_mesh<Kernel::Point_3>;
  Mesh converted;
  for (const geometry::Vec3& x : mesh.vertices) converted.add_vertex(Kernel::Point_3(x[0], x[1], x[2]));
  const auto vertex = [](std::int32_t v) { return Mesh::Vertex_index(static_cast<Mesh::size_type>(v)); };
  for (const auto& t : mesh.triangles) {
    // Two fans that meet in one vertex cannot be represented: they touch there.
    if (converted.add_face(vertex(t[0]), vertex(t[1]), vertex(t[2])) == Mesh::null_face()) return true;
  }
  return CGAL::Polygon_mesh_processing::does_self_intersect(converted);
}

}  // namespace vorocast::cvt
