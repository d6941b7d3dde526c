// SPDX-License-Identifier: AGPL-3.0-or-later
#include "scheduler/server/attempts_call.h"

#include <algorithm>

#include <fmt/format.h>

#include "absl/time/clock.h"
#include "scheduler/server/engine.h"
#include "services/rpc/status.h"

namespace vorocast::server {
namespace {

/// With logs of 64 KiB a portion stays a few megabytes.
constexpr std::int32_t kPortion = 1000;
constexpr std::int32_t kPortionWithLogs = 50;

v1::State OutcomeOf(core::AttemptEnded::Outcome outcome) {
  switch (outcome) {
    case core::AttemptEnded::Outcome::kDone:
      return v1::DONE;
    case core::AttemptEnded::Outcome::kFailed:
      return v1::FAILED;
    case core::AttemptEnded::Outcome::kCancelled:
      return v1::CANCELLED;
  }
  return v1::STATE_UNSPECIFIED;
}

double UnixSeconds(absl::Time time) { return absl::ToDoubleSeconds(time - absl::UnixEpoch()); }

}  // namespace

std::string TaskLabel(const std::string& job, const std::string& task) {
  const std::string prefix = job + "/";
  return task.starts_with(prefix) ? task.substr(prefix.size()) : task;
}

v1::TaskAttempt AttemptMessage(const core::AttemptEnded& ended) {
  v1::TaskAttempt message;
  message.set_task(ended.task);
  message.set_kind(std::string(tasks::Name(ended.kind)));
  message.set_number(ended.attempt);
  message.set_worker(ended.worker);
  message.set_started(UnixSeconds(ended.ended - ended.lasted));
  message.set_ended(UnixSeconds(ended.ended));
  message.set_outcome(OutcomeOf(ended.outcome));
  if (ended.outcome == core::AttemptEnded::Outcome::kFailed) message.set_cause(fmt::format("{}: {}", core::Name(ended.cause), ended.message));
  message.set_cpu_seconds(ended.cpu_seconds);
  message.set_memory_peak(ended.memory_peak);
  message.set_log(ended.log);
  return message;
}

std::vector<v1::TaskAttempt> RunningAttempts(const core::State& state, const core::Job& job, const std::string& task) {
  std::vector<v1::TaskAttempt> running;
  const absl::Time now = absl::Now();
  const absl::Time monotonic_now = MonotonicNow();
  for (const core::TaskIndex index : job.running) {
    const core::Task& at_work = state.tasks[index];
    const auto* wanted = std::get_if<core::Wanted>(&at_work.state);
    if (!wanted || (!task.empty() && task != at_work.name)) continue;
    const auto* leased = std::get_if<core::Leased>(&state.runs[wanted->run].state);
    if (!leased) continue;
    for (const core::Attempt& attempt : leased->attempts) {
      v1::TaskAttempt& message = running.emplace_back();
      message.set_task(at_work.name);
      message.set_kind(std::string(tasks::Name(at_work.kind)));
      message.set_number(attempt.number);
      message.set_worker(state.workers[attempt.worker].name);
      message.set_started(UnixSeconds(now - (monotonic_now - attempt.started)));
      message.set_outcome(v1::RUNNING);
    }
  }
  std::sort(running.begin(), running.end(), [](const v1::TaskAttempt& a, const v1::TaskAttempt& b) { return a.number() < b.number(); });
  return running;
}

AttemptsCall::AttemptsCall(const Catalogue& catalogue, DiskThreads& disk, const v1::AttemptsRequest& request)
    : catalogue_(catalogue),
      disk_(disk),
      query_{.job = request.job_id(),
             .task = TaskLabel(request.job_id(), request.task()),
             .logs = request.logs(),
             .count_max = request.logs() ? kPortionWithLogs : kPortion} {}

void AttemptsCall::Refuse(const absl::Status& status) { Finish(rpc::ToGrpc(status)); }

void AttemptsCall::Send(std::vector<v1::TaskAttempt> running) {
  running_ = std::move(running);
  disk_.Run([this] { WriteNext(); });
}

void AttemptsCall::WriteNext() {
  if (last_) return Finish(grpc::Status::OK);
  const auto attempts = catalogue_.FindAttempts(query_);
  if (!attempts.ok()) return Refuse(attempts.status());
  reply_.Clear();
  for (const core::AttemptEnded& ended : *attempts) {
    *reply_.add_attempts() = AttemptMessage(ended);
    // It ended since it was looked at.
    std::erase_if(running_, [&](const v1::TaskAttempt& running) { return running.number() == ended.attempt && running.task() == ended.task; });
  }
  if (!attempts->empty()) query_.after = attempts->back();
  last_ = static_cast<std::int32_t>(attempts->size()) < query_.count_max;
  if (last_) {
    for (v1::TaskAttempt& running : running_) *reply_.add_attempts() = std::move(running);
  }
  StartWrite(&reply_);
}

void AttemptsCall::OnWriteDone(bool ok) {
  if (!ok) return Refuse(absl::CancelledError("the client has gone"));
  disk_.Run([this] { WriteNext(); });
}

}  // namespace vorocast::server
