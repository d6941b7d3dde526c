// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <functional>
#include <map>
#include <numbers>
#include <vector>

#include "services/geometry/tracked_take.h"

/// Tracked takes whose motion is known, made of convex cells that fill space.
namespace vorocast::testing {

using geometry::Cells;
using geometry::Quat;
using geometry::Rigid3;
using geometry::TrackedTake;
using geometry::Vec3;

/// A convex polyhedron about the origin.
struct Polyhedron {
  std::vector<Vec3> vertices;
  std::vector<std::vector<int>> faces;  // counter-clockwise seen from outside
  double volume = 0;
};

inline Polyhedron CubeCell(double edge) {
  Polyhedron cube;
  for (int i = 0; i < 8; ++i) cube.vertices.emplace_back((i & 1 ? 0.5 : -0.5) * edge, (i & 2 ? 0.5 : -0.5) * edge, (i & 4 ? 0.5 : -0.5) * edge);
  cube.faces = {{0, 2, 3, 1}, {4, 5, 7, 6}, {0, 1, 5, 4}, {2, 6, 7, 3}, {0, 4, 6, 2}, {1, 3, 7, 5}};
  cube.volume = edge * edge * edge;
  return cube;
}

/// The truncated octahedron, Voronoi cell of the body-centred cubic lattice whose cubes have this edge.
inline Polyhedron LatticeCell(double edge) {
  Polyhedron cell;
  const double q = edge / 4;
  for (int zero = 0; zero < 3; ++zero) {
    for (const bool swap : {false, true}) {
      for (int signs = 0; signs < 4; ++signs) {
        Vec3 v = Vec3::Zero();
        v[(zero + 1) % 3] = (signs & 1 ? -1 : 1) * (swap ? 2 : 1) * q;
        v[(zero + 2) % 3] = (signs & 2 ? -1 : 1) * (swap ? 1 : 2) * q;
        cell.vertices.push_back(v);
      }
    }
  }
  std::vector<std::pair<Vec3, double>> planes;  // 6 squares and 8 hexagons
  for (int axis = 0; axis < 3; ++axis) {
    for (const double sign : {-1.0, 1.0}) planes.emplace_back(sign * Vec3::Unit(axis), 2 * q);
  }
  for (int i = 0; i < 8; ++i) planes.emplace_back(Vec3(i & 1 ? -1 : 1, i & 2 ? -1 : 1, i & 4 ? -1 : 1).normalized(), 3 * q / std::sqrt(3.0));
  for (const auto& [normal, offset] : planes) {
    std::vector<std::pair<double, int>> around;
    const Vec3 u = normal.unitOrthogonal();
    const Vec3 w = normal.cross(u);
    for (int v = 0; v < 24; ++v) {
      if (std::abs(normal.dot(cell.vertices[v]) - offset) > 1e-9 * edge + 1e-12) continue;
      around.emplace_back(std::atan2(w.dot(cell.vertices[v]), u.dot(cell.vertices[v])), v);
    }
    std::sort(around.begin(), around.end());
    cell.faces.emplace_back();
    for (const auto& [angle, v] : around) cell.faces.back().push_back(v);
  }
  cell.volume = edge * edge * edge / 2;
  return cell;
}

inline void AddCell(Cells& cells, const Polyhedron& polyhedron, const Vec3& centre) {
  if (cells.face_offset.empty()) {
    cells.face_offset.push_back(0);
    cells.vertex_offset.push_back(0);
  }
  const auto first = static_cast<std::int32_t>(cells.vertices.size());
  for (const Vec3& vertex : polyhedron.vertices) cells.vertices.push_back(vertex + centre);
  for (const std::vector<int>& face : polyhedron.faces) {
    for (const int v : face) cells.vertex.push_back(first + v);
    cells.vertex_offset.push_back(static_cast<std::int64_t>(cells.vertex.size()));
    cells.neighbour.push_back(-1);
  }
  cells.face_offset.push_back(static_cast<std::int64_t>(cells.neighbour.size()));
  cells.sites.push_back(centre);
  cells.centroid.push_back(centre);
  cells.volume.push_back(polyhedron.volume);
  cells.boundary.push_back(0);
  cells.depth.push_back(0);
  cells.component.push_back(0);
}

/// Names the cell on the other side of each face, by the middles of the faces; sets depths as the distance of the centroid from the nearest
/// face that has none.
inline void ConnectNeighbours(Cells& cells) {
  std::map<std::array<long, 3>, std::vector<std::pair<std::size_t, std::size_t>>> at;  // middle -> cell, face
  std::vector<Vec3> middles;
  for (std::size_t c = 0; c < cells.size(); ++c) {
    for (auto f = static_cast<std::size_t>(cells.face_offset[c]); f < static_cast<std::size_t>(cells.face_offset[c + 1]); ++f) {
      Vec3 middle = Vec3::Zero();
      const auto first = cells.vertex_offset[f];
      const auto last = cells.vertex_offset[f + 1];
      for (auto i = first; i < last; ++i) middle += cells.vertices[cells.vertex[i]] / static_cast<double>(last - first);
      middles.push_back(middle);
      std::array<long, 3> key;
      for (int axis = 0; axis < 3; ++axis) key[axis] = std::lround(middle[axis] * 1e5);
      at[key].emplace_back(c, f);
    }
  }
  std::vector<Vec3> skin;
  for (const auto& [key, sides] : at) {
    if (sides.size() != 2) {
      skin.push_back(middles[sides[0].second]);
      cells.boundary[sides[0].first] = 1;
      continue;
    }
    cells.neighbour[sides[0].second] = static_cast<std::int32_t>(sides[1].first);
    cells.neighbour[sides[1].second] = static_cast<std::int32_t>(sides[0].first);
  }
  for (std::size_t c = 0; c < cells.size(); ++c) {
    double nearest = 1e9;
    for (const Vec3& x : skin) nearest = std::min(nearest, (x - cells.centroid[c]).norm());
    cells.depth[c] = nearest;
  }
}

/// world_from_template of the cell at a template point, at a time.
using Motion = std::function<Rigid3(const Vec3& centre, double time)>;

inline Rigid3 Still(const Vec3&, double) { return {}; }

/// Sways about the feet and turns: fast enough to matter (its head moves a metre and more a second).
inline Rigid3 Sway(const Vec3& centre, double time) {
  const double phase = 2 * std::numbers::pi * 0.8 * time;
  const Quat lean(Eigen::AngleAxisd(0.12 * std::sin(phase) * (0.5 + centre.y()), Vec3::UnitZ()));
  const Quat turn(Eigen::AngleAxisd(0.4 * std::sin(0.5 * phase), Vec3::UnitY()));
  return {(turn * lean).normalized(), Vec3(0.3 * time, 0, 0)};
}

inline TrackedTake Animate(Cells cells, std::size_t frames, double frames_per_second, const Motion& motion) {
  TrackedTake take;
  take.frames_per_second = frames_per_second;
  const std::size_t n = cells.size();
  take.model.patch.assign(n, 0);
  take.model.patch_count = 1;
  take.patches.patch_count = 1;
  for (std::size_t f = 0; f < frames; ++f) {
    const double time = static_cast<double>(f) / frames_per_second;
    take.patches.frames.push_back(static_cast<std::int32_t>(f));
    take.patches.state.push_back(geometry::FrameState::kTracked);
    take.patches.residual.push_back(0);
    take.patches.confidence.push_back(1);
    take.patches.world_from_template.push_back(motion(Vec3(0, 0.9, 0), time));
    for (std::size_t c = 0; c < n; ++c) {
      const Rigid3 pose = motion(cells.centroid[c], time);
      take.cell_rotation.emplace_back(static_cast<float>(pose.rotation.w()), static_cast<float>(pose.rotation.x()),
                                      static_cast<float>(pose.rotation.y()), static_cast<float>(pose.rotation.z()));
      take.cell_translation.push_back(pose.translation);
    }
  }
  take.model.cells = std::move(cells);
  return take;
}

/// A block of nx × ny × nz cubes standing on y = `bottom`.
inline Cells CubeBlock(int nx, int ny, int nz, double edge, double bottom = 0) {
  Cells cells;
  const Polyhedron cube = CubeCell(edge);
  for (int y = 0; y < ny; ++y) {
    for (int z = 0; z < nz; ++z) {
      for (int x = 0; x < nx; ++x) AddCell(cells, cube, Vec3((x - 0.5 * (nx - 1)) * edge, bottom + (y + 0.5) * edge, (z - 0.5 * (nz - 1)) * edge));
    }
  }
  return cells;
}

/// A person of 1.75 m standing with arms hanging, filled with about `count` lattice cells.
inline Cells Person(int count) {
  struct Limb {
    Vec3 from, to;
    double radius;
  };
  const std::vector<Limb> limbs = {{{0, 1.00, -0.08}, {0, 1.36, -0.08}, 0.12},  {{0, 1.00, 0.08}, {0, 1.36, 0.08}, 0.12},
                                   {{0, 1.64, 0}, {0, 1.66, 0}, 0.09},          {{0, 1.45, 0}, {0, 1.60, 0}, 0.06},
                                   {{0, 0.08, -0.10}, {0, 0.95, -0.09}, 0.075}, {{0, 0.08, 0.10}, {0, 0.95, 0.09}, 0.075},
                                   {{0, 0.85, -0.30}, {0, 1.40, -0.24}, 0.05},  {{0, 0.85, 0.30}, {0, 1.40, 0.24}, 0.05}};
  const auto inside = [&](const Vec3& x) {
    for (const Limb& limb : limbs) {
      const Vec3 along = limb.to - limb.from;
      const double t = std::clamp((x - limb.from).dot(along) / along.squaredNorm(), 0.0, 1.0);
      if ((x - limb.from - t * along).norm() < limb.radius) return true;
    }
    return false;
  };
  const auto fill = [&](double edge) {
    std::vector<Vec3> centres;
    const int reach = static_cast<int>(2 / edge);
    for (int i = -reach; i <= reach; ++i) {
      for (int j = 0; j <= reach; ++j) {
        for (int k = -reach; k <= reach; ++k) {
          for (const double half : {0.0, 0.5}) {
            const Vec3 x = edge * Vec3(i + half, j + half, k + half);
            if (inside(x)) centres.push_back(x);
          }
        }
      }
    }
    return centres;
  };
  double edge = std::cbrt(2 * 0.08 / count);
  for (int round = 0; round < 4; ++round) edge *= std::cbrt(static_cast<double>(fill(edge).size()) / count);
  Cells cells;
  const Polyhedron cell = LatticeCell(edge);
  for (const Vec3& centre : fill(edge)) AddCell(cells, cell, centre);
  return cells;
}

}  // namespace vorocast::testing
