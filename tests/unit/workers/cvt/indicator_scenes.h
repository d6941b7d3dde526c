// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <CGAL/AABB_traits.h>
#include <CGAL/AABB_tree.h>
#include <CGAL/AABB_triangle_primitive.h>
#include <CGAL/Simple_cartesian.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <iomanip>
#include <optional>
#include <sstream>
#include <string>
#include <vector>

#include "services/base/random.h"
#include "services/geometry/oriented_points.h"
#include "services/geometry/triangle_mesh.h"

/// What the indicator's tests and benchmark measure with: captures, noisy scans of known surfaces, exact distances by CGAL's AABB tree.
namespace vorocast::cvt::scenes {

using geometry::OrientedPoints;
using geometry::TriangleMesh;
using geometry::Vec3;

inline std::filesystem::path DataFolder() {
  if (const char* folder = std::getenv("VOROCAST_DATA")) return folder;
  return std::filesystem::path(VOROCAST_SOURCE_DIR) / "../shared/data";
}

struct PlyFrame {
  TriangleMesh mesh;
  std::vector<Vec3> normals;
};

/// Binary little-endian PLY with float coordinates, as the captures have it; nothing if the file is absent or different.
inline std::optional<PlyFrame> ReadPly(const std::filesystem::path& path) {
  std::ifstream file(path, std::ios::binary);
  std::string line;
  std::size_t vertex_count = 0;
  std::size_t face_count = 0;
  std::size_t stride = 0;
  bool in_vertex = false;
  bool has_normals = false;
  while (std::getline(file, line) && line != "end_header") {
    std::istringstream words(line);
    std::string key;
    std::string kind;
    std::string name;
    words >> key >> kind >> name;
    if (key == "element") in_vertex = kind == "vertex";
    if (key == "element" && kind == "vertex") vertex_count = std::stoul(name);
    if (key == "element" && kind == "face") face_count = std::stoul(name);
    if (key == "property" && in_vertex) stride += kind == "uchar" ? 1 : 4;
    if (name == "nx") has_normals = true;
  }
  if (!file || vertex_count == 0) return std::nullopt;
  PlyFrame frame;
  std::vector<char> row(stride);
  for (std::size_t v = 0; v < vertex_count && file.read(row.data(), static_cast<std::streamsize>(stride)); ++v) {
    std::array<float, 6> values{};
    std::memcpy(values.data(), row.data(), has_normals ? 24 : 12);
    frame.mesh.vertices.emplace_back(values[0], values[1], values[2]);
    if (has_normals) frame.normals.emplace_back(values[3], values[4], values[5]);
  }
  for (std::size_t f = 0; f < face_count; ++f) {
    char corners = 0;
    std::array<std::int32_t, 3> triangle{};
    file.read(&corners, 1);
    file.read(reinterpret_cast<char*>(triangle.data()), sizeof triangle);
    if (corners != 3) return std::nullopt;
    frame.mesh.triangles.push_back(triangle);
  }
  if (!file) return std::nullopt;
  return frame;
}

inline std::optional<TriangleMesh> Crane(int frame) {
  std::ostringstream name;
  name << "frame_" << std::setw(4) << std::setfill('0') << frame << ".ply";
  auto read = ReadPly(DataFolder() / "crane" / name.str());
  if (!read) return std::nullopt;
  return std::move(read->mesh);
}

/// A Kinoptic frame (380 … 400) in metres, y up.
inline std::optional<OrientedPoints> Kinoptic(int frame) {
  std::ostringstream name;
  name << "ptcloud_hd" << std::setw(8) << std::setfill('0') << frame << ".ply";
  const auto read = ReadPly(DataFolder() / "kinoptic" / name.str());
  if (!read) return std::nullopt;
  OrientedPoints points;
  // Half a turn about x takes y down to y up and keeps the hand.
  for (std::size_t v = 0; v < read->normals.size(); ++v) {
    const Vec3& x = read->mesh.vertices[v];
    const Vec3& n = read->normals[v];
    if (!(n.norm() > 0.5)) continue;
    points.positions.emplace_back(0.01 * x[0], -0.01 * x[1], -0.01 * x[2]);
    points.normals.push_back(Vec3(n[0], -n[1], -n[2]).normalized());
  }
  return points;
}

/// Points of the surface moved along their normals by Gaussian noise.
inline OrientedPoints Scan(const TriangleMesh& mesh, std::size_t count, double noise_m, std::uint64_t seed) {
  OrientedPoints points = geometry::SampleSurface(mesh, count, seed);
  base::Random random(seed + 1000);
  for (std::size_t p = 0; p < points.size(); ++p) points.positions[p] += noise_m * random.Gaussian() * points.normals[p];
  return points;
}

/// Exact distances to a triangle mesh.
class DistanceTo {
 public:
  explicit DistanceTo(const TriangleMesh& mesh) {
    for (const auto& t : mesh.triangles) {
      const auto corner = [&](std::size_t i) {
        const Vec3& x = mesh.vertices[static_cast<std::size_t>(t[i])];
        return Kernel::Point_3(x[0], x[1], x[2]);
      };
      triangles_.emplace_back(corner(0), corner(1), corner(2));
    }
    tree_.insert(triangles_.begin(), triangles_.end());
    tree_.accelerate_distance_queries();
  }
  DistanceTo(const DistanceTo&) = delete;
  DistanceTo& operator=(const DistanceTo&) = delete;
  double operator()(const Vec3& x) const { return std::sqrt(tree_.squared_distance(Kernel::Point_3(x[0], x[1], x[2]))); }

 private:
  using Kernel = CGAL::Simple_cartesian<double>;
  using Triangles = std::vector<Kernel::Triangle_3>;
  using Primitive = CGAL::AABB_triangle_primitive<Kernel, Triangles::const_iterator>;
  Triangles triangles_;
  CGAL::AABB_tree<CGAL::AABB_traits<Kernel, Primitive>> tree_;
};

struct Distances {
  double mean = 0;
  double percentile95 = 0;
  double largest = 0;
};

inline Distances Measure(const std::vector<Vec3>& from, const DistanceTo& to) {
  std::vector<double> found;
  for (const Vec3& x : from) found.push_back(to(x));
  Distances result;
  for (double d : found) result.mean += d / static_cast<double>(found.size());
  std::ranges::sort(found);
  if (!found.empty()) result.percentile95 = found[found.size() * 95 / 100];
  if (!found.empty()) result.largest = found.back();
  return result;
}

}  // namespace vorocast::cvt::scenes
