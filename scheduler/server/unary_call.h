// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <functional>

#include <grpcpp/support/server_callback.h>

#include "scheduler/server/engine.h"
#include "services/rpc/status.h"

namespace vorocast::server {

/// Ends a call from the engine's thread: `work` fills `reply` within a turn, and the reply leaves once that turn is durable.
template <typename Reply>
void FinishInTurn(grpc::ServerUnaryReactor* reactor, Engine& engine, Reply* reply, std::function<absl::Status(Turn&, Reply&)> work) {
  const absl::Status accepted = engine.Ask([reactor, reply, work = std::move(work)](Turn& turn) {
    absl::Status status = work(turn, *reply);
    turn.Answer(
        [reactor, status = std::move(status)](const absl::Status& durable) { reactor->Finish(rpc::ToGrpc(durable.ok() ? status : durable)); });
  });
  if (!accepted.ok()) reactor->Finish(rpc::ToGrpc(accepted));
}

template <typename Reply>
grpc::ServerUnaryReactor* AnswerInTurn(grpc::CallbackServerContext* context, Engine& engine, Reply* reply,
                                       std::function<absl::Status(Turn&, Reply&)> work) {
  grpc::ServerUnaryReactor* reactor = context->DefaultReactor();
  FinishInTurn(reactor, engine, reply, std::move(work));
  return reactor;
}

/// Answers at once.
inline grpc::ServerUnaryReactor* Answer(grpc::CallbackServerContext* context, const absl::Status& status) {
  grpc::ServerUnaryReactor* reactor = context->DefaultReactor();
  reactor->Finish(rpc::ToGrpc(status));
  return reactor;
}

}  // namespace vorocast::server
