// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <cstdint>
#include <functional>
#include <vector>

#include "services/geometry/triangle_mesh.h"
#include "workers/cvt/field_grid.h"

namespace vorocast::cvt {

/// A surface cut out of a grid, with the grid cell each triangle lies in.
struct GridSurface {
  geometry::TriangleMesh mesh;
  std::vector<std::int64_t> triangle_cell;  // ascending; GridFrame::Index of the cell's lowest node
};

/// Where the surface crosses the grid edge from node `node` along `axis`, in [0, 1].
using CrossingFraction = std::function<double(std::size_t axis, std::size_t node)>;

/// The surface between the nodes that are inside (value > 0) and those that are not; nodes on the grid's border count as outside.
/// The result is closed, edge-manifold and oriented outward (geometry::IsClosed); empty when no node is inside. Crossings are kept
/// within [0.05, 0.95] of their edge so that no triangle is degenerate.
GridSurface MarchingCubes(const ScalarGrid& grid, const CrossingFraction& fraction);
/// The same with the crossings of the linear interpolant.
GridSurface MarchingCubes(const ScalarGrid& grid);

}  // namespace vorocast::cvt
