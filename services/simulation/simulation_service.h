// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <atomic>
#include <filesystem>

#include "proto/simulation.grpc.pb.h"
#include "services/storage/artifact_store.h"

namespace vorocast::simulation {

/// The door of its own that proto/simulation.proto describes. A run is a child process, as a leased task is: neither a crash nor a cancelled
/// call harms the service, and its result is published under the same key.
class SimulationService final : public v1::Simulation::Service {
 public:
  struct Options {
    storage::ArtifactStore store;
    std::filesystem::path program;  // run as `program execute-task`
    std::int32_t runs_max = 1;      // at once; more are refused with RESOURCE_EXHAUSTED
  };
  explicit SimulationService(Options options) : options_(std::move(options)) {}

  grpc::Status Effects(grpc::ServerContext* context, const v1::EffectsRequest* request, v1::EffectsReply* reply) override;
  grpc::Status Check(grpc::ServerContext* context, const v1::CheckRequest* request, v1::CheckReply* reply) override;
  grpc::Status Run(grpc::ServerContext* context, const v1::RunRequest* request, grpc::ServerWriter<v1::RunProgress>* writer) override;

 private:
  const Options options_;
  std::atomic<std::int32_t> runs_ = 0;
};

}  // namespace vorocast::simulation
