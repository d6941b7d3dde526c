// SPDX-License-Identifier: AGPL-3.0-or-later
#include "services/lease/dispatch_stream.h"

#include <utility>

namespace vorocast::lease {

DispatchStream::DispatchStream(v1::Dispatch::Stub& stub, std::uint64_t number, v1::Hello hello, EventQueue& events, bool wait_until_ready)
    : stub_(stub), number_(number), events_(events), wait_until_ready_(wait_until_ready), thread_([this, hello = std::move(hello)] { Run(hello); }) {}

DispatchStream::~DispatchStream() {
  context_.TryCancel();
  thread_.join();
}

void DispatchStream::Run(const v1::Hello& hello) {
  // The call is made the moment the scheduler is back; a failed call would only be tried again at the channel's next look, seconds later.
  context_.set_wait_for_ready(wait_until_ready_);
  call_ = stub_.Work(&context_);
  v1::WorkerMessage first;
  *first.mutable_hello() = hello;
  if (call_->Write(first)) {
    v1::SchedulerMessage message;
    while (call_->Read(&message)) events_.Push(StreamMessage{number_, std::move(message)});
  }
  const grpc::Status status = call_->Finish();
  events_.Push(StreamEnded{number_, status.ok() ? "the scheduler ended the stream" : status.error_message()});
}

void DispatchStream::Send(const v1::WorkerMessage& message) { call_->Write(message); }

void DispatchStream::CloseSending() { call_->WritesDone(); }

}  // namespace vorocast::lease
