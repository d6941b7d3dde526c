// SPDX-License-Identifier: AGPL-3.0-or-later
#include "scheduler/server/leadership_watch.h"

#include <chrono>

#include <spdlog/spdlog.h>

namespace vorocast::server {
namespace {

constexpr auto kPeriod = std::chrono::seconds(1);

}  // namespace

LeadershipWatch::LeadershipWatch(store::Store& store, std::function<void(const absl::Status&)> lost)
    : store_(store), lost_(std::move(lost)), thread_([this] { Run(); }) {}

LeadershipWatch::~LeadershipWatch() {
  {
    const std::lock_guard lock(mutex_);
    stopping_ = true;
  }
  wake_.notify_all();
  thread_.join();
}

void LeadershipWatch::Run() {
  bool was_known = true;
  std::unique_lock lock(mutex_);
  while (!wake_.wait_for(lock, kPeriod, [this] { return stopping_; })) {
    lock.unlock();
    const absl::Status status = store_.KeepLeading();
    if (absl::IsFailedPrecondition(status)) return lost_(status);
    if (status.ok() != was_known) {
      was_known = status.ok();
      was_known ? spdlog::info("the store answers again") : spdlog::warn("the store does not answer: error=\"{}\"", std::string(status.message()));
    }
    lock.lock();
  }
}

}  // namespace vorocast::server
