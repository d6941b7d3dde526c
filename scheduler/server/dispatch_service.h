// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <map>
#include <memory>
#include <mutex>
#include <string>

#include "proto/dispatch.grpc.pb.h"
#include "scheduler/server/engine.h"
#include "services/rpc/gate.h"

namespace vorocast::server {

class WorkStream;

/// proto/dispatch.proto: one WorkStream a worker.
class DispatchService final : public v1::Dispatch::CallbackService {
 public:
  /// `engine` and `gate` (or null) must outlive the service; `artifact_root` is what workers are told.
  DispatchService(Engine& engine, std::string artifact_root, rpc::Gate* gate = nullptr)
      : engine_(engine), artifact_root_(std::move(artifact_root)), gate_(gate) {}

  grpc::ServerBidiReactor<v1::WorkerMessage, v1::SchedulerMessage>* Work(grpc::CallbackServerContext* context) override;

  /// To the stream that it names; dropped if that has ended.
  void Send(core::Message message);
  /// Ends every stream: its worker will connect again, perhaps to the next scheduler.
  void EndStreams();

 private:
  friend class WorkStream;
  void Forget(core::ConnectionId connection);

  Engine& engine_;
  const std::string artifact_root_;
  rpc::Gate* const gate_;
  std::mutex mutex_;
  core::ConnectionId last_connection_ = 0;                             // guarded by mutex_
  std::map<core::ConnectionId, std::shared_ptr<WorkStream>> streams_;  // guarded by mutex_
};

}  // namespace vorocast::server
