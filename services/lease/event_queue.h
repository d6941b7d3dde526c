// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <cstdint>
#include <deque>
#include <optional>
#include <string>
#include <variant>

#include "absl/base/thread_annotations.h"
#include "absl/synchronization/mutex.h"
#include "absl/time/time.h"
#include "proto/dispatch.pb.h"

namespace vorocast::lease {

// Everything that happens to a lease loop. `stream` tells which connection it came over; events of an earlier one are stale.
struct StreamMessage {
  std::uint64_t stream = 0;
  v1::SchedulerMessage message;
};
struct StreamEnded {
  std::uint64_t stream = 0;
  std::string why;
};
struct AttemptEnded {
  v1::Finished finished;
};
struct DrainRequested {};
using Event = std::variant<StreamMessage, StreamEnded, AttemptEnded, DrainRequested>;

/// Events from any thread to one. Bounded by what sends: one stream's flow control, and one end for each attempt.
class EventQueue {
 public:
  void Push(Event event) {
    const absl::MutexLock lock(&mutex_);
    events_.push_back(std::move(event));
  }
  /// The next event, or nothing when `timeout` has passed.
  std::optional<Event> Pop(absl::Duration timeout) {
    const absl::MutexLock lock(&mutex_);
    const auto some = [this]() ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_) { return !events_.empty(); };
    if (!mutex_.AwaitWithTimeout(absl::Condition(&some), timeout)) return std::nullopt;
    Event event = std::move(events_.front());
    events_.pop_front();
    return event;
  }

 private:
  absl::Mutex mutex_;
  std::deque<Event> events_ ABSL_GUARDED_BY(mutex_);
};

}  // namespace vorocast::lease
