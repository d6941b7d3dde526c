// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <condition_variable>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include <grpcpp/channel.h>
#include <nlohmann/json.hpp>

#include "proto/simulation.grpc.pb.h"
#include "services/base/status.h"
#include "services/geometry/simulated_take.h"
#include "services/geometry/tracked_take.h"

namespace vorocast::simulation {

/// The client's side of a live session (proto/simulation.proto): asks, takes frames as they come, and keeps them so that they can be stored.
class LiveClient {
 public:
  struct Options {
    std::shared_ptr<grpc::Channel> channel;
    std::string tracked_key;
    nlohmann::json effect;
    /// The same take as the service has under the key.
    std::shared_ptr<const geometry::TrackedTake> take;
    /// Told of every message once it is kept, from a thread of the client's.
    std::function<void(const v1::LiveFrame&)> on_frame;
  };
  /// Returns at once; AwaitStill tells whether the session could be opened.
  explicit LiveClient(Options options);
  /// Cancels what is left of the session.
  ~LiveClient();
  LiveClient(const LiveClient&) = delete;
  LiveClient& operator=(const LiveClient&) = delete;

  /// An error once the session is over.
  absl::Status Ask(v1::LiveRequest request);
  /// Until everything asked for is answered and the run pauses. The session's error once it is over.
  absl::Status AwaitStill();
  /// Ends the session in good order.
  absl::Status Close();

  /// Writes what came so far, from frame 0 to the furthest that is as the changes made so far have it. The batch run's file if nothing was changed,
  /// but for the rounding of copies' positions.
  absl::Status Save(const std::filesystem::path& path) const;
  /// How many frames that would be.
  std::size_t frames() const;
  /// The effect that holds where the run stands, canonical; empty before the session is open.
  std::string effect_json() const;
  bool over() const;

 private:
  struct Change {
    std::size_t frame;
    std::string effect_json;
  };
  void Read();
  /// The last at or before the frame. mutex_ is held, and there is one.
  const Change& EffectAt(std::size_t frame) const;
  absl::Status Keep(const v1::LiveFrame& frame);
  absl::Status KeepInstant(const v1::LiveInstant& instant, std::size_t frame);

  const Options options_;
  grpc::ClientContext context_;
  std::unique_ptr<v1::Simulation::Stub> stub_;
  std::unique_ptr<grpc::ClientReaderWriter<v1::LiveRequest, v1::LiveFrame>> stream_;
  std::mutex write_mutex_;  // one write at a time
  bool closed_ = false;     // guarded by it: nothing may be written any more

  mutable std::mutex mutex_;
  std::condition_variable changed_;
  // All guarded by mutex_:
  std::int64_t asked_ = 1;  // to open
  std::int64_t answered_ = 0;
  bool paused_ = false;
  bool over_ = false;
  absl::Status end_;  // once it is over
  geometry::SimulatedTake frames_;
  std::size_t objects_ = 0;
  std::size_t at_ = 0;           // the frame where the run stands
  std::vector<Change> effects_;  // by frame; the first is that of frame 0

  std::thread reader_;
};

}  // namespace vorocast::simulation
