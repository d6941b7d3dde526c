// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "absl/time/time.h"
#include "proto/jobs.pb.h"

namespace vorocast::client {

/// One attempt for a terminal: a line of facts, the cause of a failure, and what it printed, indented. Ends with a newline.
std::string DescribeAttempt(const v1::TaskAttempt& attempt, absl::TimeZone zone);

/// "512 MiB"; with three digits at most.
std::string FormatBytes(std::int64_t bytes);

/// Text from elsewhere as lines that cannot move the cursor or change colours: control characters but newlines and tabs become "·", each line
/// begins with `indent`, and the last one ends.
std::string Indented(std::string_view text, std::string_view indent);

}  // namespace vorocast::client
