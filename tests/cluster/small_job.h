// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <filesystem>
#include <map>
#include <string>
#include <vector>

namespace vorocast::cluster {

/// A made-up capture of twelve frames, made once.
const std::filesystem::path& SmallCapture();

/// What the small job computes: few cells and no pictures, which take longer than all the rest.
std::vector<std::string> SmallJobFlags(const std::string& effect = "calm");

/// `vorocast run` of it; results in FOLDER/out, state in FOLDER/state.
std::vector<std::string> RunArguments(const std::filesystem::path& folder, const std::string& effect = "calm");

/// Digests of the results of an undisturbed run, made once.
const std::map<std::string, std::string>& UndisturbedDigests();

}  // namespace vorocast::cluster
