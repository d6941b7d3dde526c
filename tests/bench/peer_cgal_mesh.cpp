// SPDX-License-Identifier: AGPL-3.0-or-later
#include "tests/bench/peer_cgal_mesh.h"

#include <CGAL/Exact_predicates_inexact_constructions_kernel.h>
#include <CGAL/Mesh_complex_3_in_triangulation_3.h>
#include <CGAL/Mesh_criteria_3.h>
#include <CGAL/Mesh_triangulation_3.h>
#include <CGAL/Polyhedral_mesh_domain_3.h>
#include <CGAL/Surface_mesh.h>
#include <CGAL/make_mesh_3.h>
#include <fmt/format.h>

#include <exception>
#include <map>

namespace vorocast::bench {
namespace {

using Kernel = CGAL::Exact_predicates_inexact_constructions_kernel;
using Mesh = CGAL::Surface_mesh<Kernel::Point_3>;
using Domain = CGAL::Polyhedral_mesh_domain_3<Mesh, Kernel>;
using Triangulation = CGAL::Mesh_triangulation_3<Domain>::type;
using Complex = CGAL::Mesh_complex_3_in_triangulation_3<Triangulation>;
using Criteria = CGAL::Mesh_criteria_3<Triangulation>;

Mesh ToCgal(const geometry::TriangleMesh& surface) {
  Mesh mesh;
  std::vector<Mesh::Vertex_index> vertices;
  for (const geometry::Vec3& x : surface.vertices) vertices.push_back(mesh.add_vertex(Kernel::Point_3(x.x(), x.y(), x.z())));
  for (const auto& [a, b, c] : surface.triangles) {
    mesh.add_face(vertices[static_cast<std::size_t>(a)], vertices[static_cast<std::size_t>(b)], vertices[static_cast<std::size_t>(c)]);
  }
  return mesh;
}

Tetrahedra FromCgal(const Complex& complex) {
  Tetrahedra result;
  std::map<Triangulation::Vertex_handle, std::int32_t> numbers;
  for (auto cell = complex.cells_in_complex_begin(); cell != complex.cells_in_complex_end(); ++cell) {
    std::array<std::int32_t, 4> corners{};
    for (int i = 0; i < 4; ++i) {
      const auto [place, is_new] = numbers.try_emplace(cell->vertex(i), static_cast<std::int32_t>(result.vertices.size()));
      if (is_new) {
        const auto& p = cell->vertex(i)->point();
        result.vertices.emplace_back(CGAL::to_double(p.x()), CGAL::to_double(p.y()), CGAL::to_double(p.z()));
      }
      corners[static_cast<std::size_t>(i)] = place->second;
    }
    result.tetrahedra.push_back(corners);
  }
  return result;
}

}  // namespace

absl::StatusOr<Tetrahedra> CgalDelaunayRefinement(const geometry::TriangleMesh& surface, double ball_radius_m) {
  namespace parameters = CGAL::parameters;
  try {
    const Mesh mesh = ToCgal(surface);
    const Domain domain(mesh);
    const Criteria criteria(parameters::facet_angle = 25, parameters::facet_size = ball_radius_m, parameters::cell_radius_edge_ratio = 3,
                            parameters::cell_size = ball_radius_m);
    return FromCgal(CGAL::make_mesh_3<Complex>(domain, criteria));
  } catch (const std::exception& error) {
    return absl::InternalError(fmt::format("CGAL Mesh_3: {}", error.what()));
  }
}

}  // namespace vorocast::bench
