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
  const bool accepted = engine.Submit([reactor, reply, work = std::move(work)](Turn& turn) {
    absl::Status status = work(turn, *reply);
    turn.After([reactor, status = std::move(status)] { reactor->Finish(rpc::ToGrpc(status)); });
  });
  if (!accepted) reactor->Finish(grpc::Status(grpc::StatusCode::UNAVAILABLE, "the scheduler is stopping or overloaded; try again"));
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
