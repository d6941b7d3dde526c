// SPDX-License-Identifier: AGPL-3.0-or-later
#include "services/client/through_breaks.h"

#include <chrono>
#include <thread>

namespace vorocast::client {
namespace {

constexpr auto kPause = std::chrono::seconds(2);
constexpr auto kStep = std::chrono::milliseconds(100);

}  // namespace

bool MayPass(const absl::Status& status) {
  return absl::IsUnavailable(status) || absl::IsDeadlineExceeded(status) || absl::IsResourceExhausted(status) || absl::IsDataLoss(status);
}

void PauseInBreak() {
  for (auto passed = kStep; passed <= kPause && !Interrupted(); passed += kStep) std::this_thread::sleep_for(kStep);
}

absl::Status StoppedByUser() { return absl::CancelledError("stopped; the same command goes on from here"); }

}  // namespace vorocast::client
