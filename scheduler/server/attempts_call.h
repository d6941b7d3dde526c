// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include <grpcpp/support/server_callback.h>

#include "proto/jobs.pb.h"
#include "scheduler/core/state.h"
#include "scheduler/server/catalogue.h"
#include "scheduler/server/disk_threads.h"
#include "services/base/status.h"

namespace vorocast::server {

/// A job's attempts on their way to a client, portion by portion from the store. Owns itself until the call is over.
class AttemptsCall final : public grpc::ServerWriteReactor<v1::AttemptsReply> {
 public:
  /// Both must outlive the call; of `catalogue` only what any thread may ask.
  AttemptsCall(const Catalogue& catalogue, DiskThreads& disk, const v1::AttemptsRequest& request);

  /// Exactly one of these, once. `running`: the attempts that have not ended, which come last.
  void Send(std::vector<v1::TaskAttempt> running);
  void Refuse(const absl::Status& status);

  void OnWriteDone(bool ok) override;
  void OnCancel() override {}
  void OnDone() override { delete this; }

 private:
  void WriteNext();

  const Catalogue& catalogue_;
  DiskThreads& disk_;
  store::AttemptQuery query_;
  std::vector<v1::TaskAttempt> running_;
  v1::AttemptsReply reply_;
  bool last_ = false;
};

/// Without the name of its job in front: "frame 412: tessellate".
std::string TaskLabel(const std::string& job, const std::string& task);

/// The attempts of a job that run now, of one task or of all (empty), in the order of their numbers.
std::vector<v1::TaskAttempt> RunningAttempts(const core::State& state, const core::Job& job, const std::string& task);

v1::TaskAttempt AttemptMessage(const core::AttemptEnded& ended);

}  // namespace vorocast::server
