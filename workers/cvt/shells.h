// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <cstdint>
#include <vector>

#include "services/geometry/triangle_mesh.h"

namespace vorocast::cvt {

/// The connected pieces of a surface.
struct Shells {
  std::vector<std::int32_t> of_triangle;  // [triangles] 0 … count−1, in the order of each shell's first triangle
  std::int32_t count = 0;
  std::vector<double> area;    // [count]
  std::vector<double> volume;  // [count] signed: negative for a cavity
};
Shells FindShells(const geometry::TriangleMesh& mesh);

/// The triangles of the shells to keep and the vertices they use, both in their old order. `keep` has an entry a shell.
geometry::TriangleMesh KeepShells(const geometry::TriangleMesh& mesh, const Shells& shells, const std::vector<bool>& keep);

}  // namespace vorocast::cvt
