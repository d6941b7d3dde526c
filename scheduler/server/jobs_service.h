// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <filesystem>
#include <string>

#include "proto/jobs.grpc.pb.h"
#include "scheduler/server/catalogue.h"
#include "scheduler/server/disk_threads.h"
#include "scheduler/server/engine.h"
#include "scheduler/server/fetch_call.h"
#include "scheduler/server/fleet_note.h"
#include "scheduler/server/watch_call.h"
#include "services/rpc/gate.h"
#include "services/storage/artifact_store.h"

namespace vorocast::server {

/// proto/jobs.proto.
class JobsService final : public v1::Jobs::CallbackService {
 public:
  /// All must outlive the service.
  JobsService(Engine& engine, Catalogue& catalogue, Watchers& watchers, const storage::ArtifactStore& artifacts, DiskThreads& disk,
              const FleetNote& fleet, rpc::Gate* gate = nullptr)
      : engine_(engine), catalogue_(catalogue), watchers_(watchers), artifacts_(artifacts), disk_(disk), fleet_(fleet), gate_(gate) {}

  grpc::ServerUnaryReactor* Submit(grpc::CallbackServerContext* context, const v1::SubmitJobRequest* request, v1::Job* reply) override;
  grpc::ServerUnaryReactor* Get(grpc::CallbackServerContext* context, const v1::JobRequest* request, v1::Job* reply) override;
  grpc::ServerUnaryReactor* List(grpc::CallbackServerContext* context, const v1::ListJobsRequest* request, v1::ListJobsReply* reply) override;
  grpc::ServerWriteReactor<v1::Job>* Watch(grpc::CallbackServerContext* context, const v1::JobRequest* request) override;
  grpc::ServerUnaryReactor* Explain(grpc::CallbackServerContext* context, const v1::ExplainRequest* request, v1::ExplainReply* reply) override;
  grpc::ServerUnaryReactor* Cancel(grpc::CallbackServerContext* context, const v1::JobRequest* request, v1::Job* reply) override;
  grpc::ServerUnaryReactor* Retry(grpc::CallbackServerContext* context, const v1::RetryJobRequest* request, v1::Job* reply) override;
  grpc::ServerUnaryReactor* Pause(grpc::CallbackServerContext* context, const v1::JobRequest* request, v1::Job* reply) override;
  grpc::ServerUnaryReactor* Resume(grpc::CallbackServerContext* context, const v1::JobRequest* request, v1::Job* reply) override;
  grpc::ServerWriteReactor<v1::FetchChunk>* Fetch(grpc::CallbackServerContext* context, const v1::FetchRequest* request) override;
  grpc::ServerWriteReactor<v1::AttemptsReply>* Attempts(grpc::CallbackServerContext* context, const v1::AttemptsRequest* request) override;

 private:
  grpc::ServerUnaryReactor* SetPaused(grpc::CallbackServerContext* context, const v1::JobRequest* request, v1::Job* reply, bool paused);
  struct OutputFile {
    std::filesystem::path path;
    std::string sha256;
  };
  absl::StatusOr<OutputFile> FindOutput(Turn& turn, const std::string& id, const std::string& name) const;
  /// Does something to a job, for its owner or an operator only, and answers with the job as it is then.
  grpc::ServerUnaryReactor* Change(grpc::CallbackServerContext* context, const std::string& id, v1::Job* reply,
                                   std::function<absl::Status(Turn&)> change);
  /// Fills `reply` with the job as it is now.
  absl::Status Show(Turn& turn, const std::string& id, v1::Job& reply) const;

  Engine& engine_;
  Catalogue& catalogue_;
  Watchers& watchers_;
  const storage::ArtifactStore& artifacts_;
  DiskThreads& disk_;
  const FleetNote& fleet_;
  rpc::Gate* const gate_;
};

}  // namespace vorocast::server
