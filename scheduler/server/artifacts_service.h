// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include "proto/artifacts.grpc.pb.h"
#include "scheduler/server/disk_threads.h"
#include "scheduler/server/engine.h"
#include "scheduler/store/store.h"
#include "services/storage/artifact_store.h"

namespace vorocast::server {

/// proto/artifacts.proto.
class ArtifactsService final : public v1::Artifacts::CallbackService {
 public:
  /// All must outlive the service.
  ArtifactsService(Engine& engine, store::Store& store, const storage::ArtifactStore& artifacts, DiskThreads& disk)
      : engine_(engine), store_(store), artifacts_(artifacts), disk_(disk) {}

  grpc::ServerWriteReactor<v1::ArtifactChunk>* Get(grpc::CallbackServerContext* context, const v1::GetArtifactRequest* request) override;
  grpc::ServerReadReactor<v1::PutArtifactChunk>* Put(grpc::CallbackServerContext* context, v1::PutArtifactReply* reply) override;

 private:
  Engine& engine_;
  store::Store& store_;
  const storage::ArtifactStore& artifacts_;
  DiskThreads& disk_;
};

}  // namespace vorocast::server
