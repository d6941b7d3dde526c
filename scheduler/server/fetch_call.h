// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <cstdint>
#include <filesystem>

#include <grpcpp/support/server_callback.h>

#include "proto/artifacts.pb.h"
#include "proto/jobs.pb.h"
#include "scheduler/server/disk_threads.h"
#include "services/base/status.h"

namespace vorocast::server {

/// One file on its way out, in chunks of a message that has `size`, `sha256` and `data`. Owns itself until the call is over.
template <typename Chunk>
class FileCall final : public grpc::ServerWriteReactor<Chunk> {
 public:
  explicit FileCall(DiskThreads& disk) : disk_(disk) {}
  ~FileCall() override;

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
  Chunk chunk_;
  int file_ = -1;
  std::int64_t left_ = 0;
  bool first_ = true;
};
extern template class FileCall<v1::FetchChunk>;
extern template class FileCall<v1::ArtifactChunk>;
using FetchCall = FileCall<v1::FetchChunk>;

}  // namespace vorocast::server
