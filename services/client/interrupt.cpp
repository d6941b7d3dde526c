// SPDX-License-Identifier: AGPL-3.0-or-later
#include "services/client/interrupt.h"

#include <signal.h>

namespace vorocast::client {
namespace {

volatile sig_atomic_t interrupted = 0;

void OnSignal(int signal_number) {
  interrupted = 1;
  signal(signal_number, SIG_DFL);
}

}  // namespace

void CatchInterrupts() {
  signal(SIGINT, OnSignal);
  signal(SIGTERM, OnSignal);
}

bool Interrupted() { return interrupted != 0; }

}  // namespace vorocast::client
