// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "services/base/status.h"

namespace vorocast::client {

/// The program of that name in the folder of this one. NOT_FOUND says where it was looked for.
absl::StatusOr<std::filesystem::path> ProgramBeside(const std::string& name);

/// Becomes that program: returns only if that fails.
absl::Status BecomeProgram(const std::string& name, const std::vector<std::string>& arguments);

}  // namespace vorocast::client
