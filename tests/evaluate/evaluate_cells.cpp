// SPDX-License-Identifier: AGPL-3.0-or-later
// Scores tessellations from their files alone: evaluate_cells [--json FILE] cells.h5 [cells.h5 ...]
//
// Volumes and second moments by exact integration over the stored polyhedra (tetrahedra from the site), G3 from those, whether every cell is
// closed, and the distances of the captured points to the cells' outer surface (CGAL AABB tree). The JSON is a list in the order of the files.
#include <algorithm>
#include <array>
#include <cmath>
#include <fstream>
#include <numeric>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include <CGAL/AABB_traits.h>
#include <CGAL/AABB_tree.h>
#include <CGAL/AABB_triangle_primitive.h>
#include <CGAL/Simple_cartesian.h>
#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "services/storage/hdf5_artifacts.h"

namespace vorocast {
namespace {

using geometry::Cells;
using geometry::Vec3;
using Kernel = CGAL::Simple_cartesian<double>;
using Triangles = std::vector<Kernel::Triangle_3>;
using Primitive = CGAL::AABB_triangle_primitive<Kernel, Triangles::const_iterator>;
using Tree = CGAL::AABB_tree<CGAL::AABB_traits<Kernel, Primitive>>;

struct Score {
  double volume = 0, energy = 0, volume_difference_max = 0;
  std::size_t open_cells = 0, boundary_cells = 0;
  double distance_sum = 0, distance_max = 0;
};

/// ∫ |x|² over the tetrahedron (0, a, b, c), signed.
double SecondMoment(const Vec3& a, const Vec3& b, const Vec3& c) {
  const double volume = a.dot(b.cross(c)) / 6;
  return volume / 10 * (a.squaredNorm() + b.squaredNorm() + c.squaredNorm() + a.dot(b) + b.dot(c) + c.dot(a));
}

void ScoreCell(const Cells& cells, std::size_t c, Score& score, Triangles& surface) {
  double volume = 0;
  std::multiset<std::pair<std::int32_t, std::int32_t>> edges;
  for (auto f = static_cast<std::size_t>(cells.face_offset[c]); f < static_cast<std::size_t>(cells.face_offset[c + 1]); ++f) {
    const auto first = static_cast<std::size_t>(cells.vertex_offset[f]);
    const auto last = static_cast<std::size_t>(cells.vertex_offset[f + 1]);
    const auto corner = [&](std::size_t i) { return cells.vertices[static_cast<std::size_t>(cells.vertex[i])]; };
    for (std::size_t i = first; i < last; ++i) edges.insert({cells.vertex[i], cells.vertex[i + 1 < last ? i + 1 : first]});
    for (std::size_t i = first + 1; i + 1 < last; ++i) {
      const Vec3 a = corner(first) - cells.sites[c], b = corner(i) - cells.sites[c], d = corner(i + 1) - cells.sites[c];
      volume += a.dot(b.cross(d)) / 6;
      score.energy += SecondMoment(a, b, d);
      if (cells.neighbour[f] < 0) {
        const auto point = [](const Vec3& v) { return Kernel::Point_3(v.x(), v.y(), v.z()); };
        const Kernel::Triangle_3 triangle(point(corner(first)), point(corner(i)), point(corner(i + 1)));
        if (!triangle.is_degenerate()) surface.push_back(triangle);
      }
    }
  }
  score.volume += volume;
  score.volume_difference_max = std::max(score.volume_difference_max, std::abs(volume - cells.volume[c]) / std::max(cells.volume[c], 1e-12));
  score.boundary_cells += cells.boundary[c];
  const bool closed = std::ranges::all_of(edges, [&](const auto& e) { return edges.count(e) == edges.count({e.second, e.first}); });
  if (!closed) ++score.open_cells;
}

absl::StatusOr<nlohmann::json> Evaluate(const std::string& path) {
  ASSIGN_OR_RETURN(const Cells cells, storage::ReadCells(path));
  Score score;
  Triangles surface;
  for (std::size_t c = 0; c < cells.size(); ++c) ScoreCell(cells, c, score, surface);
  const double n = static_cast<double>(cells.size());
  const double g3 = score.energy / (3 * n * std::pow(score.volume / n, 5.0 / 3));

  Tree tree(surface.begin(), surface.end());
  tree.accelerate_distance_queries();
  for (const Vec3& p : cells.surface.positions) {
    const double distance = std::sqrt(tree.squared_distance(Kernel::Point_3(p.x(), p.y(), p.z())));
    score.distance_sum += distance;
    score.distance_max = std::max(score.distance_max, distance);
  }
  const std::set<std::int32_t> components(cells.component.begin(), cells.component.end());
  fmt::print(
      "{}: {} cells ({} at the surface, {} components), {} iterations, G3 {:.5f}, volume {:.5f} m3, open cells {}, stored volumes differ by at most "
      "{:.1e};\n"
      "  {} points: sum of distances to the surface {:.2f} m, mean {:.2f} mm, max {:.1f} mm\n",
      path, cells.size(), score.boundary_cells, components.size(), cells.iterations, g3, score.volume, score.open_cells, score.volume_difference_max,
      cells.surface.size(), score.distance_sum, 1000 * score.distance_sum / static_cast<double>(std::max<std::size_t>(1, cells.surface.size())),
      1000 * score.distance_max);
  return nlohmann::json{{"file", path},
                        {"cells", cells.size()},
                        {"g3", g3},
                        {"volume_m3", score.volume},
                        {"open_cells", score.open_cells},
                        {"points", cells.surface.size()},
                        {"distance_sum_m", score.distance_sum},
                        {"distance_max_m", score.distance_max}};
}

}  // namespace
}  // namespace vorocast

int main(int argc, char** argv) {
  std::vector<std::string> paths;
  std::string json_file;
  for (int i = 1; i < argc; ++i) {
    if (std::string(argv[i]) == "--json" && i + 1 < argc) {
      json_file = argv[++i];
    } else {
      paths.emplace_back(argv[i]);
    }
  }
  if (paths.empty()) {
    fmt::print(stderr, "usage: evaluate_cells [--json FILE] cells.h5 [cells.h5 ...]\n");
    return 2;
  }
  nlohmann::json scores = nlohmann::json::array();
  for (const std::string& path : paths) {
    const absl::StatusOr<nlohmann::json> score = vorocast::Evaluate(path);
    if (!score.ok()) {
      fmt::print(stderr, "evaluate_cells: {}\n", std::string(score.status().message()));
      return 1;
    }
    scores.push_back(*score);
  }
  if (!json_file.empty() && !(std::ofstream(json_file) << scores.dump(2) << "\n")) {
    fmt::print(stderr, "evaluate_cells: {} cannot be written\n", json_file);
    return 1;
  }
  return 0;
}
