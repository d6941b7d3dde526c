// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <cstdint>
#include <filesystem>

#include <grpcpp/support/server_callback.h>

#include "proto/jobs.pb.h"
#include "scheduler/server/disk_threads.h"
#include "services/base/status.h"

namespace vorocast::server {

/// One file on its way to a client. Owns itself until the call is over.
class FetchCall final : public grpc::ServerWriteReactor<v1::FetchChunk> {
 public:
  explicit FetchCall(DiskThreads& disk) : disk_(disk) {}
  ~FetchCall() override;

  /// Exactly one of these, once.
  void Send(const std::filesystem::path& path, const std::string& sha256);
  void Refuse(const absl::Status& status);

  void OnWriteDone(bool ok) override;
  void OnCancel() override {}
  void OnDone() override { delete this; }

 private:
  absl::Status Open(const std::filesystem::path& path, const std::string& sha256);
  void WriteNext();

  DiskThreads& disk_;
  v1::FetchChunk chunk_;
  int file_ = -1;
  std::int64_t left_ = 0;
  bool first_ = true;
};

}  // namespace vorocast::server
