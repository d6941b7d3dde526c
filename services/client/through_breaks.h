// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <functional>
#include <string>
#include <utility>

#include "services/base/status.h"
#include "services/client/interrupt.h"

namespace vorocast::client {

/// A break of the network, a scheduler that is started again, a disk that is being emptied, a file that changed while it was sent: all of them pass.
bool MayPass(const absl::Status& status);
/// Two seconds, or until the user interrupts.
void PauseInBreak();
/// "stopped; the same command goes on from here".
absl::Status StoppedByUser();

/// Calls until it works, is interrupted (CANCELLED), or fails for a reason that will not pass. Says why it waits, and when it goes on, once each.
template <typename Call>
auto ThroughBreaks(const Call& call, const std::function<void(const std::string&)>& say) -> decltype(call()) {
  bool said = false;
  while (true) {
    auto result = call();
    if (Interrupted()) return StoppedByUser();
    if (result.ok() || !MayPass(result.status())) {
      if (said && result.ok()) say("It went on.");
      return result;
    }
    if (!std::exchange(said, true)) say("Waiting, and trying again until it works: " + std::string(result.status().message()));
    PauseInBreak();
  }
}

}  // namespace vorocast::client
