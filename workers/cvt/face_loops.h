// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <cstdint>
#include <vector>

#include "services/geometry/vector.h"

namespace vorocast::cvt {

using Loop = std::vector<std::int32_t>;  // vertex numbers

/// A directed edge of a plane region's outline; the region lies to its left.
struct OutlineEdge {
  std::int32_t from, to;
};

/// Chains the edges into closed loops. Every vertex must have as many edges in as out; loops of two edges, which enclose nothing, are dropped.
/// False when an edge has no continuation.
bool ChainLoops(std::vector<OutlineEdge> edges, std::vector<Loop>* loops);

/// Turns the outlines of a plane region, counter-clockwise around it and clockwise around its holes, into simple polygons that cover it:
/// an outline without holes stays as it is; one with holes is cut into triangles. Seen against `normal`. Edges keep their direction,
/// and those added in between come in opposite pairs.
std::vector<Loop> SimplePolygons(std::vector<Loop> loops, const std::vector<geometry::Vec3>& vertices, const geometry::Vec3& normal);

}  // namespace vorocast::cvt
