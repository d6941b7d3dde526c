// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <deque>
#include <functional>
#include <memory>
#include <optional>
#include <string>

#include "absl/synchronization/mutex.h"
#include "absl/time/clock.h"
#include "proto/dispatch.grpc.pb.h"
#include "services/base/check.h"
#include "services/rpc/server.h"

namespace vorocast::lease {

/// A scheduler that says what the test tells it to, over a real gRPC server, and remembers what the worker said.
class FakeScheduler : public v1::Dispatch::Service {
 public:
  explicit FakeScheduler(const std::string& address) { server_ = rpc::StartServer({.listen = address, .services = {this}}).value(); }
  ~FakeScheduler() override { Die(); }

  /// As if killed: streams break at once.
  void Die() {
    if (server_) server_->Stop(absl::ZeroDuration());
    server_.reset();
  }

  using Stream = grpc::ServerReaderWriter<v1::SchedulerMessage, v1::WorkerMessage>;
  grpc::Status Work(grpc::ServerContext*, Stream* stream) override {
    {
      const absl::MutexLock lock(&mutex_);
      stream_ = stream;
    }
    v1::WorkerMessage message;
    while (stream->Read(&message)) {
      const absl::MutexLock lock(&mutex_);
      received_.push_back(message);
    }
    const absl::MutexLock lock(&mutex_);
    stream_ = nullptr;
    return grpc::Status::OK;
  }

  void Send(const v1::SchedulerMessage& message) {
    const absl::MutexLock lock(&mutex_);
    VOROCAST_CHECK(stream_ != nullptr);
    stream_->Write(message);
  }

  /// The first message not yet taken that is wanted; messages before it are passed over. Nothing when none comes in time.
  std::optional<v1::WorkerMessage> Await(const std::function<bool(const v1::WorkerMessage&)>& wanted) {
    const absl::Time deadline = absl::Now() + absl::Seconds(20);
    for (;;) {
      const absl::MutexLock lock(&mutex_);
      const auto some = [this] { return !received_.empty(); };
      if (!mutex_.AwaitWithDeadline(absl::Condition(&some), deadline)) return std::nullopt;
      v1::WorkerMessage message = std::move(received_.front());
      received_.pop_front();
      if (wanted(message)) return message;
    }
  }
  v1::Hello AwaitHello() {
    const auto message = Await([](const v1::WorkerMessage& m) { return m.has_hello(); });
    return message ? message->hello() : v1::Hello();
  }
  v1::Finished AwaitFinished() {
    const auto message = Await([](const v1::WorkerMessage& m) { return m.has_finished(); });
    return message ? message->finished() : v1::Finished();
  }

  void Welcome(const std::string& root, const std::vector<v1::AttemptId>& go_on = {}, const std::vector<v1::AttemptId>& drop = {}) {
    v1::SchedulerMessage message;
    message.mutable_welcome()->set_artifact_root(root);
    for (const v1::AttemptId& id : go_on) *message.mutable_welcome()->add_go_on() = id;
    for (const v1::AttemptId& id : drop) *message.mutable_welcome()->add_drop() = id;
    Send(message);
  }
  void Acknowledge(const v1::AttemptId& id) {
    v1::SchedulerMessage message;
    *message.mutable_acknowledged()->add_ids() = id;
    Send(message);
  }
  void Revoke(const v1::AttemptId& id) {
    v1::SchedulerMessage message;
    *message.mutable_revoke()->add_ids() = id;
    Send(message);
  }

 private:
  std::unique_ptr<rpc::Server> server_;
  absl::Mutex mutex_;
  Stream* stream_ ABSL_GUARDED_BY(mutex_) = nullptr;
  std::deque<v1::WorkerMessage> received_ ABSL_GUARDED_BY(mutex_);
};

}  // namespace vorocast::lease
