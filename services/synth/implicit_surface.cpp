// SPDX-License-Identifier: AGPL-3.0-or-later
#include "services/synth/implicit_surface.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "services/base/check.h"

namespace vorocast::synth {
namespace {

using geometry::Box3;
using geometry::Vec3;

/// Distance to a ball swept along a segment with a linear radius (the exact one for the cone and its two caps).
double SweptBallDistance(const Vec3& x, const Vec3& a, const Vec3& b, double ra, double rb) {
  const Vec3 axis = b - a;
  const double length2 = axis.squaredNorm();
  const double slope = ra - rb;
  const double side2 = length2 - slope * slope;
  if (side2 <= 1e-12) return (x - (ra > rb ? a : b)).norm() - std::max(ra, rb);
  const Vec3 from_a = x - a;
  const double along = from_a.dot(axis);
  const double beyond = along - length2;
  const double across2 = (from_a * length2 - axis * along).squaredNorm();
  const double along2 = along * along * length2;
  const double beyond2 = beyond * beyond * length2;
  const double k = (slope > 0 ? 1 : (slope < 0 ? -1 : 0)) * slope * slope * across2;
  if ((beyond > 0 ? 1 : -1) * side2 * beyond2 > k) return std::sqrt(across2 + beyond2) / length2 - rb;
  if ((along > 0 ? 1 : -1) * side2 * along2 < k) return std::sqrt(across2 + along2) / length2 - ra;
  return (std::sqrt(across2 * side2 / length2) + along * slope) / length2 - ra;
}

/// Values at the grid's corners. Blocks that lie wholly inside or outside get one value of the right sign.
struct Grid {
  Vec3 origin;
  double cell = 0;
  std::array<std::int32_t, 3> size{};  // corners along each axis
  std::vector<float> values;

  std::size_t Index(std::int32_t i, std::int32_t j, std::int32_t k) const {
    return (static_cast<std::size_t>(k) * static_cast<std::size_t>(size[1]) + static_cast<std::size_t>(j)) * static_cast<std::size_t>(size[0]) +
           static_cast<std::size_t>(i);
  }
  Vec3 Corner(std::int32_t i, std::int32_t j, std::int32_t k) const { return origin + cell * Vec3(i, j, k); }
};

Grid SampleGrid(const ImplicitSurface& surface, double cell, double shift) {
  constexpr std::int32_t kBlock = 4;
  const Box3 bounds = surface.Bounds();
  Grid grid{.origin = bounds.min() - Vec3::Constant(2 * cell + shift), .cell = cell};
  for (int axis = 0; axis < 3; ++axis) {
    grid.size[static_cast<std::size_t>(axis)] = static_cast<std::int32_t>(std::ceil(bounds.sizes()[axis] / cell)) + 6;
  }
  const auto [nx, ny, nz] = grid.size;
  grid.values.resize(grid.Index(0, 0, nz));
  // The field is no exact distance: blends lower it and stretches shrink it, so the test for "far away" keeps a reserve.
  const double radius = 0.5 * std::sqrt(3.0) * kBlock * cell;
  const double reach = 1.3 * radius + surface.blend_m() / 4;
  std::vector<std::size_t> near;
  for (std::int32_t k0 = 0; k0 < nz; k0 += kBlock) {
    for (std::int32_t j0 = 0; j0 < ny; j0 += kBlock) {
      for (std::int32_t i0 = 0; i0 < nx; i0 += kBlock) {
        const double middle = surface.Near(grid.Corner(i0, j0, k0) + Vec3::Constant(0.5 * (kBlock - 1) * cell), radius, near);
        const bool crossed = std::abs(middle) < reach;
        for (std::int32_t k = k0; k < std::min(k0 + kBlock, nz); ++k) {
          for (std::int32_t j = j0; j < std::min(j0 + kBlock, ny); ++j) {
            for (std::int32_t i = i0; i < std::min(i0 + kBlock, nx); ++i) {
              grid.values[grid.Index(i, j, k)] = static_cast<float>(crossed ? surface.Value(grid.Corner(i, j, k), near) : middle);
            }
          }
        }
      }
    }
  }
  return grid;
}

/// One vertex in each grid cell that the level crosses: the mean of the crossings of its edges.
std::vector<std::int32_t> PlaceVertices(const Grid& grid, geometry::TriangleMesh& mesh) {
  const auto [nx, ny, nz] = grid.size;
  std::vector<std::int32_t> vertex_of_cell(grid.values.size(), -1);
  for (std::int32_t k = 0; k + 1 < nz; ++k) {
    for (std::int32_t j = 0; j + 1 < ny; ++j) {
      for (std::int32_t i = 0; i + 1 < nx; ++i) {
        std::array<float, 8> value;
        for (std::size_t c = 0; c < 8; ++c) {
          value[c] = grid.values[grid.Index(i + static_cast<std::int32_t>(c & 1), j + static_cast<std::int32_t>(c >> 1 & 1),
                                            k + static_cast<std::int32_t>(c >> 2))];
        }
        Vec3 sum = Vec3::Zero();
        int crossings = 0;
        for (std::size_t c = 0; c < 8; ++c) {
          for (std::size_t bit : {1u, 2u, 4u}) {
            const std::size_t d = c | bit;
            if (d == c || (value[c] < 0) == (value[d] < 0)) continue;
            const double t = value[c] / (value[c] - value[d]);
            const Vec3 from(c & 1, c >> 1 & 1, c >> 2);
            const Vec3 to(d & 1, d >> 1 & 1, d >> 2);
            sum += from + t * (to - from);
            ++crossings;
          }
        }
        if (crossings == 0) continue;
        vertex_of_cell[grid.Index(i, j, k)] = static_cast<std::int32_t>(mesh.vertices.size());
        mesh.vertices.push_back(grid.Corner(i, j, k) + grid.cell * (sum / crossings));
      }
    }
  }
  return vertex_of_cell;
}

/// A quad, as two triangles, around each grid edge that the level crosses.
void JoinVertices(const Grid& grid, const std::vector<std::int32_t>& vertex_of_cell, geometry::TriangleMesh& mesh) {
  const auto [nx, ny, nz] = grid.size;
  for (std::int32_t k = 1; k + 1 < nz; ++k) {
    for (std::int32_t j = 1; j + 1 < ny; ++j) {
      for (std::int32_t i = 1; i + 1 < nx; ++i) {
        const bool inside = grid.values[grid.Index(i, j, k)] < 0;
        for (int axis = 0; axis < 3; ++axis) {
          std::array<std::int32_t, 3> step{};
          step[static_cast<std::size_t>(axis)] = 1;
          if (inside == (grid.values[grid.Index(i + step[0], j + step[1], k + step[2])] < 0)) continue;
          // The four cells around the edge, counter-clockwise seen against the axis.
          std::array<std::int32_t, 3> u{}, v{};
          u[static_cast<std::size_t>((axis + 1) % 3)] = 1;
          v[static_cast<std::size_t>((axis + 2) % 3)] = 1;
          std::array<std::int32_t, 4> q = {vertex_of_cell[grid.Index(i - u[0] - v[0], j - u[1] - v[1], k - u[2] - v[2])],
                                           vertex_of_cell[grid.Index(i - v[0], j - v[1], k - v[2])], vertex_of_cell[grid.Index(i, j, k)],
                                           vertex_of_cell[grid.Index(i - u[0], j - u[1], k - u[2])]};
          if (!inside) std::swap(q[1], q[3]);
          mesh.triangles.push_back({q[0], q[1], q[2]});
          mesh.triangles.push_back({q[0], q[2], q[3]});
        }
      }
    }
  }
}

/// Slides each vertex towards the mean of its neighbours and back onto the level, which takes the grid's pattern out of the mesh.
void SpreadVertices(const ImplicitSurface& surface, double cell, geometry::TriangleMesh& mesh) {
  constexpr int kRounds = 3, kReturns = 2;
  std::vector<std::vector<std::size_t>> near(mesh.vertices.size());
  for (std::size_t v = 0; v < near.size(); ++v) surface.Near(mesh.vertices[v], 2 * cell, near[v]);
  // The level's value is a distance to first order, so the mesh's own normals lead back to it.
  const auto back_onto_level = [&] {
    const std::vector<Vec3> normals = geometry::VertexNormals(mesh);
    for (std::size_t v = 0; v < mesh.vertices.size(); ++v) {
      mesh.vertices[v] -= std::clamp(surface.Value(mesh.vertices[v], near[v]), -0.7 * cell, 0.7 * cell) * normals[v];
    }
  };
  for (int round = 0; round < kRounds; ++round) {
    std::vector<Vec3> sum(mesh.vertices.size(), Vec3::Zero());
    std::vector<int> count(mesh.vertices.size(), 0);
    for (const auto& t : mesh.triangles) {
      for (std::size_t c = 0; c < 3; ++c) {
        sum[static_cast<std::size_t>(t[c])] += mesh.vertices[static_cast<std::size_t>(t[(c + 1) % 3])];
        ++count[static_cast<std::size_t>(t[c])];
      }
    }
    for (std::size_t v = 0; v < mesh.vertices.size(); ++v) mesh.vertices[v] += 0.6 * (sum[v] / count[v] - mesh.vertices[v]);
    back_onto_level();
  }
  for (int i = 0; i < kReturns; ++i) back_onto_level();
}

}  // namespace

double Blob::Distance(const Vec3& x) const {
  const Vec3 local = (x - from).cwiseQuotient(stretch);
  const Vec3 axis = (to - from).cwiseQuotient(stretch);
  const double d = SweptBallDistance(local, Vec3::Zero(), axis, from_radius, to_radius);
  if (stretch == Vec3::Ones()) return d;
  // In stretched space the field rises by one a metre along `rise`; in the world it rises faster where the blob is flat.
  const double length2 = axis.squaredNorm();
  const double along = length2 > 0 ? std::clamp(local.dot(axis) / length2, 0.0, 1.0) : 0.0;
  const Vec3 rise = local - along * axis;
  return d * rise.norm() / std::max(rise.cwiseQuotient(stretch).norm(), 1e-12);
}

void ImplicitSurface::Add(const Blob& blob) {
  all_.push_back(blobs_.size());
  blobs_.push_back(blob);
  const double radius = std::max(blob.from_radius, blob.to_radius) * blob.stretch.maxCoeff();
  around_.push_back({0.5 * (blob.from + blob.to), 0.5 * (blob.to - blob.from).norm() + radius});
}

double ImplicitSurface::Value(const Vec3& x, std::span<const std::size_t> near) const {
  constexpr double kFar = 1e9;
  const auto melt = [](double a, double b, double width) {
    const double h = std::max(width - std::abs(a - b), 0.0) / width;
    return std::min(a, b) - h * h * width / 4;
  };
  double whole = kFar, limb = kFar;
  std::int32_t current = -1;
  for (const std::size_t i : near) {
    if (blobs_[i].limb < 0 || blobs_[i].limb != current) {
      whole = melt(whole, limb, blend_);
      limb = kFar;
      current = blobs_[i].limb;
    }
    // A blob farther than this changes nothing.
    const double reach = std::min(whole, limb) + 2 * blend_ + around_[i].radius;
    if (reach < 0 || (x - around_[i].centre).squaredNorm() > reach * reach) continue;
    limb = melt(limb, blobs_[i].Distance(x), seam_);
  }
  return std::max(melt(whole, limb, blend_), floor_ - x.y());
}

double ImplicitSurface::Near(const Vec3& x, double radius, std::vector<std::size_t>& near) const {
  const double value = Value(x, all_);
  near.clear();
  for (std::size_t i = 0; i < around_.size(); ++i) {
    const double reach = value + 2 * radius + 2 * blend_ + around_[i].radius;
    if (reach > 0 && (x - around_[i].centre).squaredNorm() < reach * reach) near.push_back(i);
  }
  return value;
}

Box3 ImplicitSurface::Bounds() const {
  Box3 bounds;
  for (const Blob& blob : blobs_) {
    for (const auto& [centre, radius] : {std::pair(blob.from, blob.from_radius), std::pair(blob.to, blob.to_radius)}) {
      bounds.extend(centre - radius * blob.stretch);
      bounds.extend(centre + radius * blob.stretch);
    }
  }
  bounds.min().array() -= blend_ / 2;
  bounds.max().array() += blend_ / 2;
  bounds.min().y() = std::max(bounds.min().y(), floor_);
  return bounds;
}

geometry::TriangleMesh ExtractSurface(const ImplicitSurface& surface, double cell_m) {
  // Where two sheets of the level pass through one cell, its one vertex would pinch them together; a grid shifted a little has them apart.
  constexpr int kTries = 8;
  geometry::TriangleMesh mesh;
  for (int attempt = 0; attempt < kTries; ++attempt) {
    const Grid grid = SampleGrid(surface, cell_m, 0.137 * attempt * cell_m);
    mesh = {};
    const std::vector<std::int32_t> vertex_of_cell = PlaceVertices(grid, mesh);
    JoinVertices(grid, vertex_of_cell, mesh);
    if (geometry::IsClosed(mesh)) break;
  }
  VOROCAST_CHECK(geometry::IsClosed(mesh));
  SpreadVertices(surface, cell_m, mesh);
  return mesh;
}

}  // namespace vorocast::synth
