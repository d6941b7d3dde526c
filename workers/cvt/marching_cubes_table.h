// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <array>
#include <cstdint>
#include <vector>

namespace vorocast::cvt {

/// Corner c of a cube lies at (c & 1, c >> 1 & 1, c >> 2 & 1). Edge 4 a + p + 2 q runs along axis a; p and q are its offsets along the axes
/// (a + 1) % 3 and (a + 2) % 3.
using CubeTriangle = std::array<std::int8_t, 3>;  // three cube edges, counter-clockwise seen from outside the solid

/// The triangles of each of the 256 sets of inside corners (bit c: corner c is inside). Made by rule, at first use:
///  - on each face the crossings are joined so that every run of inside corners is cut off by itself. This depends on that face's
///    signs alone, so two cubes that share a face agree on it and the surface has no gap;
///  - the joins form closed loops, and each loop is cut into a fan none of whose diagonals lies in a face of the cube, so that no
///    edge inside a loop can coincide with one of the neighbouring cube.
/// Every edge of the surface therefore has exactly two triangles.
const std::array<std::vector<CubeTriangle>, 256>& MarchingCubesTable();

}  // namespace vorocast::cvt
