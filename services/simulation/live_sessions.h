// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <condition_variable>
#include <cstdint>
#include <functional>
#include <memory>
#include <mutex>
#include <string>

#include <grpcpp/support/server_callback.h>

#include "absl/time/time.h"
#include "proto/simulation.pb.h"
#include "services/base/status.h"
#include "services/geometry/tracked_take.h"

namespace vorocast::simulation {

/// The live sessions of a service (proto/simulation.proto): each a call with a thread of its own that computes frames as fast as its client takes
/// them.
class LiveSessions {
 public:
  struct Options {
    /// The take of an artifact key, as a client sends it.
    std::function<absl::StatusOr<std::shared_ptr<const geometry::TrackedTake>>(const std::string& key)> open_take;
    std::int32_t sessions_max = 4;
    absl::Duration idle_max = absl::Minutes(10);  // without a word from the client
  };
  explicit LiveSessions(Options options) : options_(std::move(options)) {}
  /// Waits for the threads of sessions; their calls have to be cancelled, or their server stopped, before.
  ~LiveSessions();
  LiveSessions(const LiveSessions&) = delete;
  LiveSessions& operator=(const LiveSessions&) = delete;

  grpc::ServerBidiReactor<v1::LiveRequest, v1::LiveFrame>* Start(grpc::CallbackServerContext* context);

 private:
  friend class LiveCall;
  bool Enter();
  void Leaving();  // its place is free
  void Left();     // its thread touches nothing any more

  const Options options_;
  std::mutex mutex_;
  std::condition_variable left_;
  std::int32_t sessions_ = 0;  // guarded by mutex_, as the next
  std::int32_t threads_ = 0;
};

}  // namespace vorocast::simulation
