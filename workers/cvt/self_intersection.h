// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include "services/geometry/triangle_mesh.h"

namespace vorocast::cvt {

/// True when two triangles of a closed mesh cross or touch other than in the corners and edges they share, or one is degenerate.
bool CrossesItself(const geometry::TriangleMesh& mesh);

}  // namespace vorocast::cvt
