// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <filesystem>

#include "services/base/progress.h"
#include "services/base/status.h"
#include "services/geometry/cells.h"
#include "services/tasks/options.h"

namespace vorocast::agent {

/// One captured frame's file to its cells: read, made a shape, cut into cells (paper, section 3). The surface that is stored with them is what was
/// observed: the frame's points, or points on its mesh where that has too few vertices to be tracked by.
absl::StatusOr<geometry::Cells> CellsOfFrame(const std::filesystem::path& path, const tasks::TessellateOptions& options,
                                             const base::Progress& progress);

}  // namespace vorocast::agent
