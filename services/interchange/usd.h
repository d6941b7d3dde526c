// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <filesystem>

#include "services/base/progress.h"
#include "services/base/status.h"
#include "services/interchange/moving_cells.h"

namespace vorocast::interchange {

/// Writes USD as text (.usda): a PointInstancer "/Take/Cells" with one prototype mesh a cell, positions, orientations and invisible ids as time
/// samples in frames of the capture; GeomSubsets "skin" and "cut" in each prototype; primvars patch and component; a PointInstancer of the same
/// prototypes for each copy of the performer, "/Take/copy_003", and a mesh with moving points for each cell that turns into another take's,
/// "/Take/pair_00042", visible while they are there; scene objects as meshes with an animated transform. Metres, y up. UNAVAILABLE when the file
/// cannot be written.
absl::Status WriteUsd(const MovingCells& take, const std::filesystem::path& path, const base::Progress& progress);

}  // namespace vorocast::interchange
