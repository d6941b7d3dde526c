// SPDX-License-Identifier: AGPL-3.0-or-later
#include "workers/cvt/marching_cubes.h"

#include <algorithm>
#include <array>
#include <cstring>

#include "workers/cvt/marching_cubes_table.h"

namespace vorocast::cvt {
namespace {

using geometry::Vec3;

/// Goes through the grid slab by slab (i, then i + 1); keeps the vertex numbers of one slab's crossed edges.
class Marcher {
 public:
  Marcher(const ScalarGrid& grid, const CrossingFraction& fraction) : frame_(grid.frame), fraction_(fraction) {
    ny_ = static_cast<std::size_t>(frame_.nodes[1]);
    nz_ = static_cast<std::size_t>(frame_.nodes[2]);
    slice_ = ny_ * nz_;
    // Eight bytes more, so that eight nodes can be looked at in one load at the end of the last row.
    inside_.assign(grid.value.size() + 8, 0);
    for (std::int32_t i = 1; i + 1 < frame_.nodes[0]; ++i) {
      for (std::int32_t j = 1; j + 1 < frame_.nodes[1]; ++j) {
        const std::size_t row = frame_.Index(i, j, 0);
        for (std::size_t k = 1; k + 1 < nz_; ++k) inside_[row + k] = grid.value[row + k] > 0 ? 1 : 0;
      }
    }
    for (auto& numbers : {&along_x_, &low_y_, &low_z_, &high_y_, &high_z_}) numbers->resize(slice_);
  }

  GridSurface Run() {
    const std::size_t slices = static_cast<std::size_t>(frame_.nodes[0]);
    NumberSlice(0, low_y_, low_z_);
    for (std::size_t i = 0; i + 1 < slices; ++i) {
      NumberBetween(i);
      NumberSlice(i + 1, high_y_, high_z_);
      for (std::size_t j = 0; j + 1 < ny_; ++j) EmitRow(i, j);
      std::swap(low_y_, high_y_);
      std::swap(low_z_, high_z_);
    }
    return std::move(surface_);
  }

 private:
  using Numbers = std::vector<std::int32_t>;  // [slice] vertex on the edge that starts at this node; set only where the edge is crossed

  std::uint64_t Eight(std::size_t node) const {
    std::uint64_t bytes;
    std::memcpy(&bytes, &inside_[node], sizeof bytes);
    return bytes;
  }

  std::int32_t AddVertex(std::size_t axis, std::size_t node) {
    const double t = std::clamp(fraction_(axis, node), 0.05, 0.95);
    const std::size_t in_slice = node % slice_;
    Vec3 cell(static_cast<double>(node / slice_), static_cast<double>(in_slice / nz_), static_cast<double>(in_slice % nz_));
    cell[static_cast<Eigen::Index>(axis)] += t;
    surface_.mesh.vertices.push_back(frame_.origin + frame_.spacing * cell);
    return static_cast<std::int32_t>(surface_.mesh.vertices.size()) - 1;
  }

  /// Vertices on the edges between node rows `row` and `row + step`, for every k where they differ.
  void NumberRow(std::size_t axis, std::size_t row, std::size_t step, Numbers& numbers) {
    for (std::size_t k = 0; k < nz_; k += 8) {
      if (Eight(row + k) == Eight(row + k + step)) continue;
      for (std::size_t n = k; n < std::min(k + 8, nz_); ++n) {
        if (inside_[row + n] != inside_[row + n + step]) numbers[(row + n) % slice_] = AddVertex(axis, row + n);
      }
    }
  }

  void NumberSlice(std::size_t i, Numbers& along_y, Numbers& along_z) {
    for (std::size_t j = 0; j < ny_; ++j) {
      const std::size_t row = i * slice_ + j * nz_;
      if (j + 1 < ny_) NumberRow(1, row, nz_, along_y);
      NumberRow(2, row, 1, along_z);
    }
  }

  void NumberBetween(std::size_t i) {
    for (std::size_t j = 0; j < ny_; ++j) NumberRow(0, i * slice_ + j * nz_, slice_, along_x_);
  }

  void EmitRow(std::size_t i, std::size_t j) {
    const std::size_t row = i * slice_ + j * nz_;
    constexpr std::uint64_t kAllInside = 0x0101010101010101ULL;
    for (std::size_t k = 0; k + 1 < nz_; k += 8) {
      std::uint64_t any = 0;
      std::uint64_t all = kAllInside;
      for (std::size_t corner_row : {row, row + nz_, row + slice_, row + slice_ + nz_}) {
        any |= Eight(corner_row + k) | inside_[corner_row + std::min(k + 8, nz_ - 1)];
        all &= Eight(corner_row + k);
        all &= inside_[corner_row + std::min(k + 8, nz_ - 1)] != 0 ? kAllInside : 0;
      }
      if (any == 0 || all == kAllInside) continue;
      for (std::size_t n = k; n < std::min(k + 8, nz_ - 1); ++n) EmitCell(row + n, j * nz_ + n);
    }
  }

  void EmitCell(std::size_t node, std::size_t in_slice) {
    const std::size_t above = node + nz_;
    const std::uint32_t inside = static_cast<std::uint32_t>(inside_[node] | inside_[node + slice_] << 1 | inside_[above] << 2 |
                                                            inside_[above + slice_] << 3 | inside_[node + 1] << 4 | inside_[node + slice_ + 1] << 5 |
                                                            inside_[above + 1] << 6 | inside_[above + slice_ + 1] << 7);
    if (inside == 0 || inside == 255) return;
    for (const CubeTriangle& triangle : MarchingCubesTable()[inside]) {
      surface_.mesh.triangles.push_back({VertexOn(triangle[0], in_slice), VertexOn(triangle[1], in_slice), VertexOn(triangle[2], in_slice)});
      surface_.triangle_cell.push_back(static_cast<std::int64_t>(node));
    }
  }

  /// Edge 4 a + p + 2 q: see marching_cubes_table.h.
  std::int32_t VertexOn(std::int8_t edge, std::size_t in_slice) const {
    const std::size_t p = edge & 1;
    const std::size_t q = edge >> 1 & 1;
    switch (edge / 4) {
      case 0:
        return along_x_[in_slice + p * nz_ + q];
      case 1:
        return (q == 0 ? low_y_ : high_y_)[in_slice + p];
      default:
        return (p == 0 ? low_z_ : high_z_)[in_slice + q * nz_];
    }
  }

  const GridFrame frame_;
  const CrossingFraction& fraction_;
  std::size_t ny_;
  std::size_t nz_;
  std::size_t slice_;
  std::vector<std::uint8_t> inside_;
  Numbers along_x_;
  Numbers low_y_;
  Numbers low_z_;
  Numbers high_y_;
  Numbers high_z_;
  GridSurface surface_;
};

}  // namespace

GridSurface MarchingCubes(const ScalarGrid& grid, const CrossingFraction& fraction) { return Marcher(grid, fraction).Run(); }

GridSurface MarchingCubes(const ScalarGrid& grid) {
  const std::array<std::size_t, 3> step = {static_cast<std::size_t>(grid.frame.nodes[1]) * static_cast<std::size_t>(grid.frame.nodes[2]),
                                           static_cast<std::size_t>(grid.frame.nodes[2]), 1};
  return MarchingCubes(grid, [&](std::size_t axis, std::size_t node) {
    const double a = grid.value[node];
    const double b = grid.value[node + step[axis]];
    // Equal signs occur only where the border was forced outside: the surface then runs half-way.
    return (a > 0) == (b > 0) ? 0.5 : a / (a - b);
  });
}

}  // namespace vorocast::cvt
