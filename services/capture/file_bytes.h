// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>

#include "services/base/status.h"

namespace vorocast::capture {

/// A regular file's whole content. NOT_FOUND, PERMISSION_DENIED or INVALID_ARGUMENT (no regular file, more than `size_max` bytes) do not name the
/// path: the caller does.
absl::StatusOr<std::string> ReadFileBytes(const std::filesystem::path& path, std::uint64_t size_max);

}  // namespace vorocast::capture
