// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include "services/geometry/simulated_take.h"
#include "services/geometry/tracked_take.h"
#include "services/rendering/sheet.h"

namespace vorocast::rendering {

/// Everything that is there at one stored instant of a simulated take: cells, copies, cells that turn into another take's, and objects.
/// `model` and `take` outlive the picture, and fit each other: as many cells.
CellsPicture PictureOf(const geometry::Template& model, const geometry::SimulatedTake& take, std::size_t step);

}  // namespace vorocast::rendering
