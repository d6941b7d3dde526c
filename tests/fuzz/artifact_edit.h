// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <cstddef>
#include <filesystem>
#include <string_view>

namespace vorocast::fuzz {

inline constexpr std::size_t kArtifactEditBytes = 8;

/// Changes an HDF5 file in place, at most eight times: `edits` holds kArtifactEditBytes for each change. Equal bytes make equal changes.
void EditArtifact(const std::filesystem::path& path, std::string_view edits);

}  // namespace vorocast::fuzz
