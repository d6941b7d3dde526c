// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include "proto/capture.grpc.pb.h"
#include "scheduler/server/catalogue.h"
#include "scheduler/server/disk_threads.h"
#include "scheduler/server/engine.h"
#include "scheduler/server/scheduler_metrics.h"
#include "services/storage/artifact_store.h"

namespace vorocast::server {

/// proto/capture.proto.
class CapturesService final : public v1::Captures::CallbackService {
 public:
  /// All must outlive the service.
  CapturesService(Engine& engine, Catalogue& catalogue, const storage::ArtifactStore& artifacts, DiskThreads& disk, SchedulerMetrics& metrics)
      : engine_(engine), catalogue_(catalogue), artifacts_(artifacts), disk_(disk), metrics_(metrics) {}

  grpc::ServerUnaryReactor* Open(grpc::CallbackServerContext* context, const v1::OpenSequenceRequest* request, v1::Sequence* reply) override;
  grpc::ServerUnaryReactor* Missing(grpc::CallbackServerContext* context, const v1::MissingRequest* request, v1::MissingReply* reply) override;
  grpc::ServerReadReactor<v1::UploadChunk>* Upload(grpc::CallbackServerContext* context, v1::UploadReply* reply) override;
  grpc::ServerUnaryReactor* Add(grpc::CallbackServerContext* context, const v1::AddFramesRequest* request, v1::Sequence* reply) override;
  grpc::ServerUnaryReactor* Close(grpc::CallbackServerContext* context, const v1::CloseSequenceRequest* request, v1::Sequence* reply) override;

 private:
  Engine& engine_;
  Catalogue& catalogue_;
  const storage::ArtifactStore& artifacts_;
  DiskThreads& disk_;
  SchedulerMetrics& metrics_;
};

}  // namespace vorocast::server
