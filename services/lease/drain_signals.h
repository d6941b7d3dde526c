// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <signal.h>

#include <functional>
#include <thread>

#include "services/base/status.h"

namespace vorocast::lease {

/// While it lives, SIGTERM and SIGINT call `on_signal` from a thread of its own instead of ending the process, and SIGPIPE is ignored.
/// One at a time in a process.
class DrainSignals {
 public:
  explicit DrainSignals(std::function<void()> on_signal);
  ~DrainSignals();
  DrainSignals(const DrainSignals&) = delete;
  DrainSignals& operator=(const DrainSignals&) = delete;

 private:
  struct sigaction earlier_term_ {};
  struct sigaction earlier_int_ {};
  struct sigaction earlier_pipe_ {};
  std::thread thread_;
};

}  // namespace vorocast::lease
