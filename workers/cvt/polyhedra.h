// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include "services/base/status.h"
#include "services/geometry/cells.h"
#include "workers/cvt/clipped_cells.h"

namespace vorocast::cvt {

/// Appends the closed polyhedra of one solid's clipped cells to `cells`: faces with other cells first, each the part of a bisector that
/// lies in the solid, then the pieces of the surface. Vertices are welded by what meets in them, never by distance. Appends sites, volumes,
/// centroids and boundary flags as well. INTERNAL when the complex is not closed.
absl::Status AppendPolyhedra(const ClippedCells& clipped, const ClippedComplex& complex, geometry::Cells* cells);

}  // namespace vorocast::cvt
