// SPDX-License-Identifier: AGPL-3.0-or-later
#include "scheduler/server/watch_call.h"

#include "scheduler/server/job_message.h"
#include "services/rpc/status.h"

namespace vorocast::server {
namespace {

constexpr absl::Duration kPeriod = absl::Milliseconds(200);

}  // namespace

std::shared_ptr<WatchCall> WatchCall::Make() {
  auto call = std::make_shared<WatchCall>();
  call->self_ = call;
  return call;
}

void WatchCall::Push(v1::Job job, bool last) {
  const std::lock_guard lock(mutex_);
  if (ended_ || last_pushed_) return;
  next_ = std::move(job);
  last_pushed_ = last;
  if (!is_writing_) WriteNext();
}

void WatchCall::WriteNext() {
  writing_ = *std::move(next_);
  next_.reset();
  is_writing_ = true;
  StartWrite(&writing_);
}

void WatchCall::OnWriteDone(bool ok) {
  if (!ok) return End(absl::UnavailableError("the stream broke"));
  const std::lock_guard lock(mutex_);
  is_writing_ = false;
  if (ended_) return;
  if (next_) return WriteNext();
  if (!last_pushed_) return;
  ended_ = true;
  Finish(grpc::Status::OK);
}

void WatchCall::End(const absl::Status& status) {
  const std::lock_guard lock(mutex_);
  if (ended_) return;
  ended_ = true;
  Finish(rpc::ToGrpc(status));
}

bool WatchCall::has_ended() {
  const std::lock_guard lock(mutex_);
  return ended_ || last_pushed_;
}

void Watchers::Add(Turn& turn, const CatalogueJob& job, std::shared_ptr<WatchCall> call) {
  Watched& watched = jobs_[job.added.id];
  watched.calls.push_back(std::move(call));
  Send(turn, job.added.id, watched);
}

void Watchers::Changed(Turn& turn, const std::set<std::string>& jobs) {
  if (jobs_.empty()) return;
  for (const std::string& job : jobs) {
    if (const auto found = jobs_.find(job); found != jobs_.end()) found->second.changed = true;
  }
  for (auto at = jobs_.begin(); at != jobs_.end();) {
    auto& [id, watched] = *at;
    std::erase_if(watched.calls, [](const auto& call) { return call->has_ended(); });
    if (watched.calls.empty()) {
      at = jobs_.erase(at);
      continue;
    }
    if (watched.changed && MonotonicNow() - watched.sent >= kPeriod) Send(turn, id, watched);
    ++at;
  }
}

void Watchers::Send(Turn& turn, const std::string& id, Watched& watched) {
  const auto job = catalogue_.FindJob(id);
  if (!job.ok()) return;
  // The many outputs of single frames are listed once, at the end; until then they would be most of the message.
  auto message = JobMessage(turn.state(), catalogue_, **job, FrameOutputs::kLeftOut);
  const bool last = message.ok() && HasEnded(message->state());
  if (last) message = JobMessage(turn.state(), catalogue_, **job, FrameOutputs::kListed);
  watched.changed = false;
  watched.sent = MonotonicNow();
  if (!message.ok()) {
    return turn.After([calls = watched.calls, status = message.status()] {
      for (const auto& call : calls) call->End(status);
    });
  }
  turn.After([calls = watched.calls, message = *std::move(message), last] {
    for (const auto& call : calls) call->Push(message, last);
  });
}

void Watchers::EndAll(const absl::Status& status) {
  for (auto& [id, watched] : jobs_) {
    for (const auto& call : watched.calls) call->End(status);
  }
  jobs_.clear();
}

}  // namespace vorocast::server
