// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <vector>

#include "services/geometry/vector.h"

namespace vorocast::bench {

struct BoxCells {
  std::vector<double> volume;            // [n] m³
  std::vector<geometry::Vec3> centroid;  // [n]
};

/// The Voronoi cells of sites in a box, by voro++.
BoxCells VoroCells(const std::vector<geometry::Vec3>& sites, const geometry::Box3& box);

}  // namespace vorocast::bench
