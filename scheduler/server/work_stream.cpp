// SPDX-License-Identifier: AGPL-3.0-or-later
#include "scheduler/server/work_stream.h"

#include <spdlog/spdlog.h>

#include "scheduler/server/dispatch_service.h"
#include "scheduler/server/work_messages.h"
#include "services/rpc/status.h"

namespace vorocast::server {

void WorkStream::ReadNext() {
  const std::lock_guard lock(mutex_);
  if (!ended_) StartRead(&incoming_);
}

void WorkStream::Send(v1::SchedulerMessage message) {
  const std::lock_guard lock(mutex_);
  if (ended_) return;
  outgoing_.push_back(std::move(message));
  if (outgoing_.size() == 1) StartWrite(&outgoing_.front());
}

void WorkStream::End(const absl::Status& status) {
  const std::lock_guard lock(mutex_);
  if (ended_) return;
  ended_ = true;
  Finish(rpc::ToGrpc(status));
}

void WorkStream::OnWriteDone(bool ok) {
  if (!ok) return End(absl::UnavailableError("the stream broke"));
  const std::lock_guard lock(mutex_);
  outgoing_.pop_front();
  if (!ended_ && !outgoing_.empty()) StartWrite(&outgoing_.front());
}

void WorkStream::OnReadDone(bool ok) {
  if (!ok) return End(absl::OkStatus());
  Take(incoming_);
}

void WorkStream::Take(const v1::WorkerMessage& message) {
  // A stream lasts as long as its worker; a token may be withdrawn before.
  if (const auto caller = rpc::CallerOf(context_, service_.gate_); !caller.ok()) return End(caller.status());
  if (message.has_hello() != worker_.empty()) return End(absl::InvalidArgumentError("the first message, and only that, is a Hello"));
  auto event = EventOf(connection_, message);
  if (!event.ok()) return End(event.status());
  if (message.has_hello()) {
    worker_ = message.hello().worker();
    spdlog::info("worker connected: worker={} slots={} holding={} connection={}", worker_, message.hello().slots(), message.hello().holding_size(),
                 connection_);
  }
  const bool accepted = service_.engine_.Submit([self = shared_from_this(), event = *std::move(event)](Turn& turn) {
    turn.Apply(event);
    turn.After([self] { self->ReadNext(); });
  });
  if (!accepted) End(absl::UnavailableError("the scheduler is stopping or overloaded"));
}

void WorkStream::OnDone() {
  if (!worker_.empty()) {
    spdlog::info("worker disconnected: worker={} connection={}", worker_, connection_);
    service_.engine_.Enqueue([connection = connection_](Turn& turn) { turn.Apply(core::WorkerDisconnected{connection}); });
  }
  service_.Forget(connection_);
}

grpc::ServerBidiReactor<v1::WorkerMessage, v1::SchedulerMessage>* DispatchService::Work(grpc::CallbackServerContext* context) {
  std::shared_ptr<WorkStream> stream;
  {
    const std::lock_guard lock(mutex_);
    const core::ConnectionId connection = ++last_connection_;
    stream = std::make_shared<WorkStream>(*this, connection, *context);
    streams_.emplace(connection, stream);
  }
  stream->Begin();
  return stream.get();
}

void DispatchService::Send(core::Message message) {
  std::shared_ptr<WorkStream> stream;
  {
    const std::lock_guard lock(mutex_);
    const auto found = streams_.find(message.connection);
    if (found == streams_.end()) return;
    stream = found->second;
  }
  stream->Send(MessageOf(message, artifact_root_));
}

void DispatchService::EndStreams() {
  std::vector<std::shared_ptr<WorkStream>> streams;
  {
    const std::lock_guard lock(mutex_);
    for (const auto& [connection, stream] : streams_) streams.push_back(stream);
  }
  for (const auto& stream : streams) stream->End(absl::UnavailableError("the scheduler is stopping"));
}

void DispatchService::Forget(core::ConnectionId connection) {
  std::shared_ptr<WorkStream> last;
  const std::lock_guard lock(mutex_);
  if (const auto found = streams_.find(connection); found != streams_.end()) {
    last = std::move(found->second);
    streams_.erase(found);
  }
}

}  // namespace vorocast::server
