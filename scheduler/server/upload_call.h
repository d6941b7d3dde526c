// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <grpcpp/support/server_callback.h>

#include "proto/capture.pb.h"
#include "scheduler/server/disk_threads.h"
#include "scheduler/server/incoming_file.h"
#include "scheduler/server/scheduler_metrics.h"
#include "services/base/digest.h"
#include "services/base/status.h"
#include "services/storage/artifact_store.h"

namespace vorocast::server {

/// Checks a blob's name as a client states it. INVALID_ARGUMENT names the field.
absl::StatusOr<base::Digest> CheckBlob(const v1::Blob& blob);

/// One blob on its way into the store. Owns itself until the call is over; a broken call leaves nothing behind.
class UploadCall final : public grpc::ServerReadReactor<v1::UploadChunk> {
 public:
  /// All must outlive the call.
  UploadCall(const storage::ArtifactStore& artifacts, DiskThreads& disk, SchedulerMetrics& metrics);

  void OnReadDone(bool ok) override;
  void OnCancel() override {}
  void OnDone() override { delete this; }

 private:
  absl::Status Begin(const v1::Blob& blob);
  absl::Status Write(const std::string& bytes);
  absl::Status Publish();
  void Take(bool ok);

  const storage::ArtifactStore& artifacts_;
  DiskThreads& disk_;
  SchedulerMetrics& metrics_;
  v1::UploadChunk chunk_;
  v1::Blob blob_;
  base::Digest digest_;
  IncomingFile file_;
};

}  // namespace vorocast::server
