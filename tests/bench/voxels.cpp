// SPDX-License-Identifier: AGPL-3.0-or-later
#include "tests/bench/voxels.h"

#include <algorithm>
#include <array>
#include <cstdint>
#include <vector>

#include "workers/cvt/field_grid.h"
#include "workers/cvt/winding_grid.h"
#include "workers/cvt/x_rays.h"

namespace vorocast::bench {
namespace {

using cvt::GridFrame;
using geometry::Cells;
using geometry::Vec3;

GridFrame FrameAround(const geometry::TriangleMesh& solid, double edge_m) {
  geometry::Box3 box;
  for (const Vec3& x : solid.vertices) box.extend(x);
  GridFrame frame;
  frame.spacing = edge_m;
  frame.origin = box.min() - Vec3::Constant(1.5 * edge_m);
  for (std::size_t axis = 0; axis < 3; ++axis) {
    frame.nodes[axis] = static_cast<std::int32_t>(box.sizes()[static_cast<Eigen::Index>(axis)] / edge_m) + 4;
  }
  return frame;
}

/// 1 at the nodes that lie in the solid.
std::vector<std::uint8_t> NodesInside(const geometry::TriangleMesh& solid, const GridFrame& frame) {
  const cvt::XRays rays(solid.vertices, solid.triangles);
  std::vector<std::uint8_t> inside(frame.size(), 0);
  std::vector<double> crossings;
  for (std::int32_t j = 0; j < frame.nodes[1]; ++j) {
    for (std::int32_t k = 0; k < frame.nodes[2]; ++k) {
      rays.Crossings(frame.origin.y() + frame.spacing * j, frame.origin.z() + frame.spacing * k, &crossings);
      std::size_t passed = 0;
      for (std::int32_t i = 0; i < frame.nodes[0]; ++i) {
        while (passed < crossings.size() && crossings[passed] < frame.origin.x() + frame.spacing * i) ++passed;
        inside[frame.Index(i, j, k)] = passed % 2;
      }
    }
  }
  return inside;
}

class Cubes {
 public:
  Cubes(const GridFrame& frame, const std::vector<std::uint8_t>& inside) : frame_(frame), cube_(frame.size(), -1), vertex_(frame.size(), -1) {
    std::int32_t count = 0;
    ForEachCube([&](std::int32_t i, std::int32_t j, std::int32_t k) {
      bool touched = false;
      for (std::int32_t corner = 0; corner < 8; ++corner)
        touched |= inside[frame_.Index(i + (corner & 1), j + (corner >> 1 & 1), k + (corner >> 2))] != 0;
      if (touched) cube_[frame_.Index(i, j, k)] = count++;
    });
  }

  Cells Build() {
    cells_.face_offset.push_back(0);
    cells_.vertex_offset.push_back(0);
    ForEachCube([&](std::int32_t i, std::int32_t j, std::int32_t k) {
      if (cube_[frame_.Index(i, j, k)] >= 0) AddCube(i, j, k);
    });
    return std::move(cells_);
  }

 private:
  template <typename Visit>
  void ForEachCube(Visit&& visit) const {
    for (std::int32_t i = 0; i + 1 < frame_.nodes[0]; ++i) {
      for (std::int32_t j = 0; j + 1 < frame_.nodes[1]; ++j) {
        for (std::int32_t k = 0; k + 1 < frame_.nodes[2]; ++k) visit(i, j, k);
      }
    }
  }

  std::int32_t Vertex(const std::array<std::int32_t, 3>& node) {
    std::int32_t& number = vertex_[frame_.Index(node[0], node[1], node[2])];
    if (number < 0) {
      number = static_cast<std::int32_t>(cells_.vertices.size());
      cells_.vertices.push_back(frame_.origin + frame_.spacing * Vec3(node[0], node[1], node[2]));
    }
    return number;
  }

  void AddCube(std::int32_t i, std::int32_t j, std::int32_t k) {
    bool boundary = false;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      for (const std::int32_t side : {0, 1}) {
        // Around the axis, the other two in cyclic order run counter-clockwise seen from its far end.
        for (std::size_t turn = 0; turn < 4; ++turn) {
          constexpr std::array<std::array<std::int32_t, 2>, 4> kLoop = {{{0, 0}, {1, 0}, {1, 1}, {0, 1}}};
          const auto& at = kLoop[side == 1 ? turn : 3 - turn];
          std::array<std::int32_t, 3> node = {i, j, k};
          node[axis] += side;
          node[(axis + 1) % 3] += at[0];
          node[(axis + 2) % 3] += at[1];
          cells_.vertex.push_back(Vertex(node));
        }
        cells_.vertex_offset.push_back(static_cast<std::int64_t>(cells_.vertex.size()));
        std::array<std::int32_t, 3> other = {i, j, k};
        other[axis] += side == 1 ? 1 : -1;
        cells_.neighbour.push_back(std::ranges::min(other) < 0 ? -1 : cube_[frame_.Index(other[0], other[1], other[2])]);
        boundary |= cells_.neighbour.back() < 0;
      }
    }
    cells_.face_offset.push_back(static_cast<std::int64_t>(cells_.neighbour.size()));
    const Vec3 centre = frame_.origin + frame_.spacing * Vec3(i + 0.5, j + 0.5, k + 0.5);
    const double volume = frame_.spacing * frame_.spacing * frame_.spacing;
    cells_.sites.push_back(centre);
    cells_.centroid.push_back(centre);
    cells_.volume.push_back(volume);
    cells_.boundary.push_back(boundary ? 1 : 0);
    cells_.depth.push_back(0);
    cells_.component.push_back(0);
    cells_.energy += volume * frame_.spacing * frame_.spacing / 4;
  }

  const GridFrame& frame_;
  std::vector<std::int32_t> cube_;    // by lowest node; −1 where there is none
  std::vector<std::int32_t> vertex_;  // by node
  Cells cells_;
};

}  // namespace

Voxels MakeVoxels(const geometry::TriangleMesh& solid, double edge_m) {
  const GridFrame frame = FrameAround(solid, edge_m);
  return {Cubes(frame, NodesInside(solid, frame)).Build(), cvt::CutWindingNumber(solid, frame).mesh};
}

}  // namespace vorocast::bench
