// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <atomic>
#include <condition_variable>
#include <cstdint>
#include <deque>
#include <memory>
#include <mutex>
#include <optional>

#include "absl/time/time.h"
#include "services/simulation/live_run.h"
#include "services/simulation/live_sessions.h"

namespace vorocast::simulation {

/// One live session: gRPC's callbacks fill a bounded queue of requests, the session's thread works them off and computes.
class LiveCall final : public grpc::ServerBidiReactor<v1::LiveRequest, v1::LiveFrame>, public std::enable_shared_from_this<LiveCall> {
 public:
  /// Keeps itself alive until gRPC and its thread are done with it.
  static LiveCall* Start(LiveSessions& sessions, grpc::CallbackServerContext* context);

  void OnReadDone(bool ok) override;
  void OnWriteDone(bool ok) override;
  void OnCancel() override;
  void OnDone() override { self_.reset(); }

 private:
  LiveCall(LiveSessions& sessions, grpc::CallbackServerContext* context) : sessions_(sessions), context_(context) {}

  void Run();
  /// Until the client has gone, or an error ends the session.
  absl::Status Serve();
  absl::Status Open(const v1::LiveRequest& request);
  absl::Status Answer(const v1::LiveRequest& request);
  absl::Status PlayOne();
  absl::Status SendScene();
  absl::Status SendInstant(int steps, double seconds);
  void Fill(v1::LiveInstant& instant) const;
  absl::Status Refuse(const absl::Status& why);
  /// Waits until the message before is written. CANCELLED when the client has gone, DEADLINE_EXCEEDED when it has stopped taking anything.
  absl::Status Send(v1::LiveFrame frame);
  /// The next request, or nothing when there is something to play. Errors as Send's.
  absl::StatusOr<std::optional<v1::LiveRequest>> Next();
  absl::Status Gone() const { return absl::CancelledError("the client has gone"); }
  absl::Status Idle() const;
  bool playing() const { return to_play_ != 0; }

  LiveSessions& sessions_;
  grpc::CallbackServerContext* const context_;
  std::shared_ptr<LiveCall> self_;

  std::mutex mutex_;
  std::condition_variable changed_;
  std::deque<v1::LiveRequest> requests_;  // guarded by mutex_, as what follows
  std::size_t waiting_bytes_ = 0;         // of them
  bool read_waits_ = false;               // the queue is full
  bool writing_ = false;
  std::int64_t sent_ = 0;
  std::int64_t received_ = 0;  // by the client, as it says
  std::uint64_t heard_ = 0;    // messages of the client
  std::atomic<bool> gone_ = false;
  v1::LiveRequest reading_;
  v1::LiveFrame written_;

  // The session's thread's own.
  std::shared_ptr<const geometry::TrackedTake> take_;
  std::unique_ptr<LiveRun> live_;
  std::int64_t answered_ = 0;
  std::int64_t to_play_ = 0;  // frames; negative: until the end
};

}  // namespace vorocast::simulation
