// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <cstdint>
#include <vector>

#include "services/geometry/cells.h"

namespace vorocast::simulation {

/// Two cells that share a face (paper, section 6.1.2: the graph that a CVT is).
struct CellEdge {
  std::int32_t a = 0;  // a < b
  std::int32_t b = 0;
  double area = 0;             // m²
  double distance = 0;         // between the centroids, metres
  geometry::Vec3 face_centre;  // in the template
};

/// All pairs that share a face, sorted, each once. Cells of different components never share one, so nothing ever leaks between them.
std::vector<CellEdge> CellEdges(const geometry::Cells& cells);

}  // namespace vorocast::simulation
