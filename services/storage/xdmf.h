// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <filesystem>

#include "services/base/status.h"

namespace vorocast::storage {

/// Writes an XDMF file that ParaView opens: the cells of `artifact` as points at their centroids, with their volume, depth, patch and state, over
/// time for a take; copies and the pairs of a morph as points of two further collections, "copies" and "pairs", at the instants that have any.
/// `artifact` is a cells.h5, a tracked.h5, or a simulated.h5, whose shapes are in `tracked`, the take that it was run on (else empty). Moved
/// centroids and states go into `<xdmf>.h5` beside it, because XDMF cannot turn by quaternions; the rest is read from the artifacts, by their
/// absolute paths. INVALID_ARGUMENT for other files.
absl::Status WriteXdmf(const std::filesystem::path& artifact, const std::filesystem::path& tracked, const std::filesystem::path& xdmf);

}  // namespace vorocast::storage
