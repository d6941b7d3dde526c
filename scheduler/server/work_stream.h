// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <deque>
#include <memory>
#include <mutex>
#include <string>

#include <grpcpp/support/server_callback.h>

#include "proto/dispatch.pb.h"
#include "scheduler/core/event.h"
#include "scheduler/server/engine.h"
#include "services/base/status.h"

namespace vorocast::server {

class DispatchService;

/// One worker's stream. At most one of its messages waits for the engine: the next is read once that turn is done, so a flood of
/// messages stays with its sender.
class WorkStream final : public grpc::ServerBidiReactor<v1::WorkerMessage, v1::SchedulerMessage>, public std::enable_shared_from_this<WorkStream> {
 public:
  WorkStream(DispatchService& service, core::ConnectionId connection, grpc::CallbackServerContext& context)
      : service_(service), connection_(connection), context_(context) {}
  /// Apart from the constructor because it needs the shared pointer.
  void Begin() { ReadNext(); }

  void Send(v1::SchedulerMessage message);
  /// Ends the stream from this side; harmless when it has ended.
  void End(const absl::Status& status);

  void OnReadDone(bool ok) override;
  void OnWriteDone(bool ok) override;
  void OnCancel() override { End(absl::CancelledError("the worker has gone")); }
  void OnDone() override;

 private:
  void ReadNext();
  void Take(const v1::WorkerMessage& message);

  DispatchService& service_;
  const core::ConnectionId connection_;
  grpc::CallbackServerContext& context_;
  std::string worker_;  // read side only
  v1::WorkerMessage incoming_;
  std::mutex mutex_;
  bool ended_ = false;                         // guarded by mutex_
  std::deque<v1::SchedulerMessage> outgoing_;  // guarded by mutex_; the front one is being written
};

}  // namespace vorocast::server
