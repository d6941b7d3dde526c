// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "absl/time/time.h"
#include "services/base/status.h"

namespace vorocast::fleet {

struct CommandLimits {
  absl::Duration time = absl::Seconds(30);
  std::size_t output_bytes = std::size_t{64} << 20;
};

/// Runs a program found in PATH with these arguments, without a shell and with no more of this process's environment than such a program needs;
/// gives what it printed on standard output. UNAVAILABLE when it cannot be started, ends with another code than 0 (with what it wrote on standard
/// error), or takes too long; RESOURCE_EXHAUSTED when it prints too much. It has ended in any case.
absl::StatusOr<std::string> RunCommand(const std::vector<std::string>& arguments, const CommandLimits& limits = {});

}  // namespace vorocast::fleet
