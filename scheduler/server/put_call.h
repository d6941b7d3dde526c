// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <grpcpp/support/server_callback.h>

#include <string>

#include "proto/artifacts.pb.h"
#include "scheduler/server/disk_threads.h"
#include "scheduler/server/engine.h"
#include "scheduler/server/incoming_file.h"
#include "services/base/digest.h"
#include "services/base/status.h"
#include "services/storage/artifact_store.h"

namespace vorocast::server {

/// One result on its way into the store from a worker that cannot write there. Owns itself until the call is over; a broken call leaves nothing
/// behind.
class PutCall final : public grpc::ServerReadReactor<v1::PutArtifactChunk> {
 public:
  PutCall(Engine& engine, const storage::ArtifactStore& artifacts, DiskThreads& disk);

  void OnReadDone(bool ok) override;
  void OnCancel() override {}
  void OnDone() override { delete this; }

 private:
  void Take(bool ok);
  absl::Status ReadName();
  /// Goes on with Begin when a leased task has the key.
  void AskWhetherLeased();
  void Begin();
  absl::Status Publish();
  void End(const absl::Status& status);

  Engine& engine_;
  const storage::ArtifactStore& artifacts_;
  DiskThreads& disk_;
  v1::PutArtifactChunk chunk_;
  base::Digest key_, sha256_;
  std::string extension_;
  std::int64_t size_ = -1;  // negative until the first message has been read
  IncomingFile file_;
};

}  // namespace vorocast::server
