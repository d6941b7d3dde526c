// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace vorocast::fuzz {

/// The target's own inputs: MadeInputs(), then the files of its folder in the order of their names. Never empty.
std::vector<std::string> Corpus();

/// The bytes of a file; ends the program with a message if it cannot be read.
std::string ReadInput(const std::filesystem::path& path);

}  // namespace vorocast::fuzz
