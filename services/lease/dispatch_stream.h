// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <cstdint>
#include <memory>
#include <thread>

#include <grpcpp/client_context.h>

#include "proto/dispatch.grpc.pb.h"
#include "services/lease/event_queue.h"

namespace vorocast::lease {

/// One connection to the scheduler, from Hello to its end. A thread opens it, so that a scheduler which does not answer holds nobody up, and then
/// passes every message on to the queue; the last event is StreamEnded.
class DispatchStream {
 public:
  /// `wait_until_ready`: for a scheduler that is the only one; otherwise one that is away ends the stream at once.
  DispatchStream(v1::Dispatch::Stub& stub, std::uint64_t number, v1::Hello hello, EventQueue& events, bool wait_until_ready = true);
  /// Cancels the call if it has not ended.
  ~DispatchStream();

  std::uint64_t number() const { return number_; }
  /// Only after the first message has come, from one thread. A failed write shows as StreamEnded.
  void Send(const v1::WorkerMessage& message);
  /// Says that nothing more will be sent; the scheduler then ends the call.
  void CloseSending();

 private:
  void Run(const v1::Hello& hello);

  v1::Dispatch::Stub& stub_;
  const std::uint64_t number_;
  EventQueue& events_;
  const bool wait_until_ready_;
  grpc::ClientContext context_;
  std::unique_ptr<grpc::ClientReaderWriter<v1::WorkerMessage, v1::SchedulerMessage>> call_;  // set by the thread before its first event
  std::thread thread_;
};

}  // namespace vorocast::lease
