// SPDX-License-Identifier: AGPL-3.0-or-later
#include "workers/cvt/marching_cubes_table.h"

#include <bit>

#include "services/base/check.h"

namespace vorocast::cvt {
namespace {

constexpr std::int8_t kNone = -1;

struct CubeFace {
  std::array<std::int32_t, 4> corner;  // counter-clockwise seen from outside the cube
};

std::int32_t Corner(std::int32_t axis, std::int32_t along, std::int32_t p, std::int32_t q) {
  return along << axis | p << (axis + 1) % 3 | q << (axis + 2) % 3;
}

std::array<CubeFace, 6> Faces() {
  std::array<CubeFace, 6> faces;
  for (std::int32_t axis = 0; axis < 3; ++axis) {
    const auto at = [&](std::int32_t side, std::int32_t p, std::int32_t q) { return Corner(axis, side, p, q); };
    faces[static_cast<std::size_t>(2 * axis)].corner = {at(0, 0, 0), at(0, 0, 1), at(0, 1, 1), at(0, 1, 0)};
    faces[static_cast<std::size_t>(2 * axis + 1)].corner = {at(1, 0, 0), at(1, 1, 0), at(1, 1, 1), at(1, 0, 1)};
  }
  return faces;
}

std::int8_t EdgeBetween(std::int32_t a, std::int32_t b) {
  const std::int32_t axis = std::countr_zero(static_cast<std::uint32_t>(a ^ b));
  return static_cast<std::int8_t>(4 * axis + (a >> (axis + 1) % 3 & 1) + 2 * (a >> (axis + 2) % 3 & 1));
}

/// The two faces an edge lies in, as bits 2 axis + side.
std::uint32_t FacesOfEdge(std::int8_t edge) {
  const std::int32_t axis = edge / 4;
  return 1U << (2 * ((axis + 1) % 3) + edge % 2) | 1U << (2 * ((axis + 2) % 3) + edge / 2 % 2);
}

/// For every crossed edge of the cube, the one that follows it on the boundary of the surface patch.
std::array<std::int8_t, 12> JoinCrossings(std::uint32_t inside) {
  static const std::array<CubeFace, 6> faces = Faces();
  const auto is_inside = [&](std::int32_t corner) { return (inside >> corner & 1) != 0; };
  std::array<std::int8_t, 12> next;
  next.fill(kNone);
  for (const CubeFace& face : faces) {
    const auto corner = [&](std::size_t i) { return face.corner[i % 4]; };
    for (std::size_t i = 0; i < 4; ++i) {
      if (is_inside(corner(i)) || !is_inside(corner(i + 1))) continue;
      // Going round the face, a run of inside corners starts after i; the join goes from where it starts to where it ends.
      std::size_t last = i + 1;
      while (is_inside(corner(last + 1))) ++last;
      next[static_cast<std::size_t>(EdgeBetween(corner(i), corner(i + 1)))] = EdgeBetween(corner(last), corner(last + 1));
    }
  }
  return next;
}

bool FanStaysInside(const std::vector<std::int8_t>& loop, std::size_t apex) {
  for (std::size_t d = 2; d + 1 < loop.size(); ++d) {
    if ((FacesOfEdge(loop[apex]) & FacesOfEdge(loop[(apex + d) % loop.size()])) != 0) return false;
  }
  return true;
}

void AddFan(const std::vector<std::int8_t>& loop, std::vector<CubeTriangle>& triangles) {
  std::size_t apex = 0;
  while (apex < loop.size() && !FanStaysInside(loop, apex)) ++apex;
  VOROCAST_CHECK(apex < loop.size());
  for (std::size_t d = 1; d + 1 < loop.size(); ++d) {
    triangles.push_back({loop[apex], loop[(apex + d) % loop.size()], loop[(apex + d + 1) % loop.size()]});
  }
}

std::array<std::vector<CubeTriangle>, 256> MakeTable() {
  std::array<std::vector<CubeTriangle>, 256> table;
  for (std::uint32_t inside = 0; inside < 256; ++inside) {
    std::array<std::int8_t, 12> next = JoinCrossings(inside);
    for (std::int8_t start = 0; start < 12; ++start) {
      std::vector<std::int8_t> loop;
      for (std::int8_t edge = start; next[static_cast<std::size_t>(edge)] != kNone;) {
        loop.push_back(edge);
        const std::int8_t following = next[static_cast<std::size_t>(edge)];
        next[static_cast<std::size_t>(edge)] = kNone;
        edge = following;
      }
      if (!loop.empty()) AddFan(loop, table[inside]);
    }
  }
  return table;
}

}  // namespace

const std::array<std::vector<CubeTriangle>, 256>& MarchingCubesTable() {
  static const std::array<std::vector<CubeTriangle>, 256> table = MakeTable();
  return table;
}

}  // namespace vorocast::cvt
