// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <filesystem>
#include <istream>
#include <string>

#include "services/base/status.h"
#include "services/rpc/security.h"

namespace vorocast::simulation {

/// A live session on a terminal: a line a frame, commands from the keyboard or from a script.
struct LiveOptions {
  std::filesystem::path tracked;
  std::string effect;  // as LoadEffect takes it
  std::string at;      // the service to use: HOST:PORT or unix:/PATH; empty: one of this process's own
  rpc::ClientSecurity security;
};

/// Works off `commands` to their end. With `wait` each waits until the one before has come to its end, and the first that is refused ends it with its
/// error: for scripts. Otherwise commands hold at once, whatever runs.
absl::Status RunLive(const LiveOptions& options, std::istream& commands, bool wait);

}  // namespace vorocast::simulation
