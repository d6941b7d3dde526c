// SPDX-License-Identifier: AGPL-3.0-or-later
// How far captured points are from a surface, from the files alone: evaluate_surface [--json FILE] cells.h5 surface.off [surface.off ...]
//
// The points are those that cells.h5 was made of (/surface/points); the surfaces are meshes that somebody else made of the same points. Distances are
// exact (CGAL AABB tree). The JSON is a list in the order of the surfaces.
#include <algorithm>
#include <cmath>
#include <fstream>
#include <string>
#include <vector>

#include <CGAL/AABB_traits.h>
#include <CGAL/AABB_tree.h>
#include <CGAL/AABB_triangle_primitive.h>
#include <CGAL/Simple_cartesian.h>
#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "services/capture/frame_reader.h"
#include "services/storage/hdf5_artifacts.h"

namespace vorocast {
namespace {

using geometry::Vec3;
using Kernel = CGAL::Simple_cartesian<double>;
using Triangles = std::vector<Kernel::Triangle_3>;
using Primitive = CGAL::AABB_triangle_primitive<Kernel, Triangles::const_iterator>;
using Tree = CGAL::AABB_tree<CGAL::AABB_traits<Kernel, Primitive>>;

Kernel::Point_3 Point(const Vec3& x) { return {x.x(), x.y(), x.z()}; }

absl::StatusOr<nlohmann::json> Evaluate(const std::vector<Vec3>& points, const std::string& path) {
  ASSIGN_OR_RETURN(const capture::RawFrame frame, capture::ReadRawFrame(path));
  Triangles triangles;
  for (const auto& t : frame.mesh.triangles) {
    const auto corner = [&](std::size_t i) { return Point(frame.mesh.vertices[static_cast<std::size_t>(t[i])]); };
    const Kernel::Triangle_3 triangle(corner(0), corner(1), corner(2));
    if (!triangle.is_degenerate()) triangles.push_back(triangle);
  }
  if (triangles.empty()) return absl::InvalidArgumentError(fmt::format("{}: no triangle that has an area", path));
  Tree tree(triangles.begin(), triangles.end());
  tree.accelerate_distance_queries();
  double sum = 0, max = 0;
  for (const Vec3& x : points) {
    const double distance = std::sqrt(tree.squared_distance(Point(x)));
    sum += distance;
    max = std::max(max, distance);
  }
  fmt::print("{}: {} triangles; {} points: sum of distances {:.2f} m, mean {:.2f} mm, max {:.1f} mm\n", path, triangles.size(), points.size(), sum,
             1000 * sum / static_cast<double>(std::max<std::size_t>(1, points.size())), 1000 * max);
  return nlohmann::json{{"file", path}, {"triangles", triangles.size()}, {"points", points.size()}, {"distance_sum_m", sum}, {"distance_max_m", max}};
}

absl::Status EvaluateAll(const std::string& cells_path, const std::vector<std::string>& surfaces, const std::string& json_file) {
  ASSIGN_OR_RETURN(const storage::ObservedCells cells, storage::ReadObservedCells(cells_path));
  nlohmann::json scores = nlohmann::json::array();
  for (const std::string& path : surfaces) {
    ASSIGN_OR_RETURN(nlohmann::json score, Evaluate(cells.surface.positions, path));
    scores.push_back(std::move(score));
  }
  if (!json_file.empty() && !(std::ofstream(json_file) << scores.dump(2) << "\n")) return absl::UnknownError(json_file + " cannot be written");
  return absl::OkStatus();
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
  if (paths.size() < 2) {
    fmt::print(stderr, "usage: evaluate_surface [--json FILE] cells.h5 surface.off [surface.off ...]\n");
    return 2;
  }
  const absl::Status status = vorocast::EvaluateAll(paths[0], {paths.begin() + 1, paths.end()}, json_file);
  if (!status.ok()) fmt::print(stderr, "evaluate_surface: {}\n", std::string(status.message()));
  return status.ok() ? 0 : 1;
}
