// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include "workers/tracking/patch_model.h"

namespace vorocast::tracking {

/// Points on the cells' surface faces (neighbour −1), about `spacing_m` apart and at least one a boundary cell, each of its cell's patch.
/// Positions lie on the faces; normals are averaged over the vicinity, so that the facets of a clipped cell do not show.
std::vector<SurfaceSample> SampleTemplateSurface(const geometry::Cells& cells, const std::vector<std::int32_t>& patch, double spacing_m);

}  // namespace vorocast::tracking
