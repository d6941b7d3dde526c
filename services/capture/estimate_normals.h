// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <vector>

#include "services/base/status.h"
#include "services/geometry/vector.h"

namespace vorocast::capture {

/// Unit outward normals of a point cloud that has none: a plane fitted to each point's neighbours, signs spread along a minimum spanning
/// tree of similar neighbours, and each connected part turned so that its normals point away from its inside. A normal is zero where the
/// points around say nothing. INVALID_ARGUMENT for fewer than 16 points. About 30 µs a point.
absl::StatusOr<std::vector<geometry::Vec3>> EstimateNormals(const std::vector<geometry::Vec3>& positions);

/// How much normals point away from the inside, in [−1, 1]: the flux of (p − centroid) through the surface over the same without signs. A
/// closed surface has more than 0 when its normals point outward and less when they point inward. Points count alike.
double Outwardness(const std::vector<geometry::Vec3>& positions, const std::vector<geometry::Vec3>& normals);

}  // namespace vorocast::capture
