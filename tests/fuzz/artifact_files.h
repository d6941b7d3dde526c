// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "tests/fuzz/scratch_folder.h"

namespace vorocast::fuzz {

/// Made at the first call; a process of its own for an input uses its parent's.
const ScratchFolder& ArtifactFolder();

/// One valid file of every content that services/storage knows, as bytes.
const std::vector<std::string>& SmallArtifacts();

/// Reads the file with every reader of services/storage. What any of them lets through must be sound, and they must agree with one another.
void ReadEveryWay(const std::filesystem::path& path);

}  // namespace vorocast::fuzz
