// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <string>

#include "services/storage/hdf5_artifacts.h"

/// What is wrong with the values of an artifact, as "dataset: reason"; empty when nothing is. Readers call these after reading and writers before
/// writing, so that nothing is published that could not be read back. Private to services/storage.
namespace vorocast::storage {

/// `group` is put before dataset names: "" or "/template".
std::string FaultIn(const geometry::Cells& cells, const std::string& group);
std::string FaultIn(const ObservedCells& observed);
/// Also that every patch 0 … patch_count−1 has a cell, and every cell a patch.
std::string FaultIn(const geometry::Template& model, const std::string& group);
std::string FaultIn(const geometry::PoseTrack& track);
std::string FaultIn(const geometry::TrackedTake& take);
std::string FaultIn(const geometry::SimulatedTake& take);

}  // namespace vorocast::storage
