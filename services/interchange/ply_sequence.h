// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <filesystem>

#include "services/base/progress.h"
#include "services/base/status.h"
#include "services/interchange/moving_cells.h"

namespace vorocast::interchange {

/// Writes `<folder>/cells_000000.ply` …, one binary PLY an instant: the surface that can be seen, which is the skin and the cuts that have opened
/// (the cell on the other side is released, gone or smaller, or this one is), copies with all their faces, and cells on their way into another
/// take's. Polygons with the face properties cell, patch, skin (1, or 0 for a cut), state (0 recalled, 1 released) and, in takes that have them, copy
/// and pair (numbers, −1 for neither); vertices are those of the cells, in metres, not shared between cells. Scene objects are not in it. Creates the
/// folder; UNAVAILABLE when a file cannot be written.
absl::Status WritePlySequence(const MovingCells& take, const std::filesystem::path& folder, const base::Progress& progress);

}  // namespace vorocast::interchange
