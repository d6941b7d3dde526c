// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <filesystem>
#include <string>
#include <string_view>

namespace vorocast::fuzz {

/// Before the first input: bounds memory, and sees to it that whatever ends the program leaves the input that did it in `folder`, with the
/// command that repeats it on standard error. Nothing is written when `folder` is empty.
void Watch(const std::string& program, const std::filesystem::path& folder);

/// From now on nothing is written: whoever waits for this process keeps the input if it must be.
void KeepNoInput();

/// Around every input; it must live until WatchedInputEnds. An input that takes more than ten seconds of CPU, or two minutes, counts as a hang.
void WatchedInputBegins(std::string_view input);
void WatchedInputEnds();

}  // namespace vorocast::fuzz
