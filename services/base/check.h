// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <string_view>

namespace vorocast::base {

/// Prints the failed condition with its place and aborts. A programmer's error: bad input is an absl::Status instead.
[[noreturn]] void CheckFailed(std::string_view condition, const char* file, int line);

}  // namespace vorocast::base

/// Holds in release builds too.
#define VOROCAST_CHECK(condition)                                                    \
  do {                                                                               \
    if (!(condition)) ::vorocast::base::CheckFailed(#condition, __FILE__, __LINE__); \
  } while (false)
