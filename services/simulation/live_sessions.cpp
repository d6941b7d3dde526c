// SPDX-License-Identifier: AGPL-3.0-or-later
#include "services/simulation/live_sessions.h"

#include <fmt/format.h>

#include "services/simulation/live_call.h"

namespace vorocast::simulation {

LiveSessions::~LiveSessions() {
  std::unique_lock lock(mutex_);
  left_.wait(lock, [this] { return threads_ == 0; });
}

bool LiveSessions::Enter() {
  const std::lock_guard lock(mutex_);
  if (sessions_ >= options_.sessions_max) return false;
  ++sessions_;
  ++threads_;
  return true;
}

void LiveSessions::Leaving() {
  const std::lock_guard lock(mutex_);
  --sessions_;
}

void LiveSessions::Left() {
  const std::lock_guard lock(mutex_);
  --threads_;
  left_.notify_all();
}

grpc::ServerBidiReactor<v1::LiveRequest, v1::LiveFrame>* LiveSessions::Start(grpc::CallbackServerContext* context) {
  return LiveCall::Start(*this, context);
}

}  // namespace vorocast::simulation
