// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <filesystem>

#include "services/base/progress.h"
#include "services/base/status.h"
#include "services/interchange/moving_cells.h"

namespace vorocast::interchange {

/// Writes binary glTF 2.0 (.glb), which Blender, Houdini, Unreal and every web viewer open: one node a cell, "cell_00042", its polyhedron about its
/// centroid with the materials "skin" and "cut", its motion as linear translation and rotation channels at the take's instants; cells that are
/// gone are scaled to nothing. Copies are nodes that show their cell's mesh, "copy_003_cell_00042", and cells that turn into another take's are nodes
/// with a morph target, "pair_00042", material "turning"; both have size 0 while they are not there. Scene objects are nodes likewise. A node's
/// extras hold cell, patch, component, copy, pair and target (the other take's cell), those that it has. RESOURCE_EXHAUSTED for more than the 4 GiB
/// that the format can hold; UNAVAILABLE when the file cannot be written.
absl::Status WriteGltf(const MovingCells& take, const std::filesystem::path& path, const base::Progress& progress);

}  // namespace vorocast::interchange
