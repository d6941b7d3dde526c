// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include "services/base/status.h"
#include "services/geometry/triangle_mesh.h"
#include "tests/bench/tetrahedra.h"

namespace vorocast::bench {

/// TetGen's quality mesh ("pq1.4a") of the solid inside a closed surface, which it keeps: no tetrahedron is larger than `volume_max_m3`. INTERNAL
/// when TetGen gives up.
absl::StatusOr<Tetrahedra> TetGenMesh(const geometry::TriangleMesh& surface, double volume_max_m3);

}  // namespace vorocast::bench
