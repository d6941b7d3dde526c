// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <atomic>
#include <filesystem>
#include <map>
#include <memory>
#include <mutex>
#include <string>

#include "absl/time/time.h"
#include "proto/simulation.grpc.pb.h"
#include "services/simulation/live_sessions.h"
#include "services/storage/artifact_store.h"

namespace vorocast::simulation {

/// The door of its own that proto/simulation.proto describes. A run is a child process, as a leased task is: neither a crash nor a cancelled
/// call harms the service, and its result is published under the same key. A live session is a thread: see live_sessions.h.
class SimulationService final : public v1::Simulation::WithCallbackMethod_Live<v1::Simulation::Service> {
 public:
  struct Options {
    storage::ArtifactStore store;
    std::filesystem::path program;  // run as `program execute-task`
    std::int32_t runs_max = 1;      // at once; more are refused with RESOURCE_EXHAUSTED
    std::int32_t live_max = 4;      // live sessions at once; likewise
    absl::Duration live_idle = absl::Minutes(10);
  };
  explicit SimulationService(Options options);

  grpc::Status Effects(grpc::ServerContext* context, const v1::EffectsRequest* request, v1::EffectsReply* reply) override;
  grpc::Status Check(grpc::ServerContext* context, const v1::CheckRequest* request, v1::CheckReply* reply) override;
  grpc::Status Run(grpc::ServerContext* context, const v1::RunRequest* request, grpc::ServerWriter<v1::RunProgress>* writer) override;
  grpc::ServerBidiReactor<v1::LiveRequest, v1::LiveFrame>* Live(grpc::CallbackServerContext* context) override { return live_.Start(context); }

 private:
  /// From the store; sessions on one take share it.
  absl::StatusOr<std::shared_ptr<const geometry::TrackedTake>> OpenTake(const std::string& key);

  const Options options_;
  std::mutex mutex_;
  std::map<std::string, std::weak_ptr<const geometry::TrackedTake>> takes_;  // by key; guarded by mutex_
  LiveSessions live_;                                                        // after what its sessions use
  std::atomic<std::int32_t> runs_ = 0;
};

}  // namespace vorocast::simulation
