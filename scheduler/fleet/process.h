// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <sys/types.h>

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "services/base/status.h"

namespace vorocast::fleet {

/// A process that may be another's child. The start time tells it from a later process of the same number.
struct ProcessId {
  pid_t pid = -1;
  std::uint64_t start_time = 0;  // field 22 of /proc/PID/stat, clock ticks since boot
};

/// Runs `arguments[0]` in a process group of its own, so that neither a terminal's Ctrl-C nor this process's death reaches it; what it
/// prints is appended to `log`.
absl::StatusOr<ProcessId> StartProcess(const std::vector<std::string>& arguments, const std::filesystem::path& log);

/// Reaps it first if it is this process's own child and has ended.
bool IsAlive(const ProcessId& process);

/// To its whole group; nothing if it has ended.
void Signal(const ProcessId& process, int signal);

}  // namespace vorocast::fleet
