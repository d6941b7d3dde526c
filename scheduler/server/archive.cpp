// SPDX-License-Identifier: AGPL-3.0-or-later
#include "scheduler/server/archive.h"

#include <algorithm>

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include "scheduler/server/job_message.h"

namespace vorocast::server {
namespace {

/// What the core may go on to know of ended jobs: their tasks can be asked about one by one.
constexpr std::size_t kKeptTasks = 10'000;
constexpr std::size_t kKeptJobs = 100;

absl::StatusOr<v1::Job> Read(const Catalogue& catalogue, const std::string& job) {
  ASSIGN_OR_RETURN(const std::string bytes, catalogue.EndedText(job, store::JobText::kWhole));
  v1::Job message;
  if (!message.ParseFromString(bytes)) return absl::DataLossError(fmt::format("the record of job {} cannot be read", job));
  return message;
}

/// What the attempts at a task of an ended job tell about it.
absl::StatusOr<std::string> ExplainByAttempts(const Catalogue& catalogue, const std::string& job, const std::string& task, const std::string& state) {
  ASSIGN_OR_RETURN(const std::vector<core::AttemptEnded> attempts, catalogue.FindAttempts({.job = job, .task = task}));
  if (attempts.empty()) {
    return fmt::format(
        "{} ended a while ago and is {}; no attempt at \"{}\" is on record: its result existed already, it was never started, its record was "
        "too old to be kept, or the job has no such task.",
        job, state, task);
  }
  const core::AttemptEnded& last = attempts.back();
  const auto failed = std::count_if(attempts.begin(), attempts.end(),
                                    [](const core::AttemptEnded& attempt) { return attempt.outcome == core::AttemptEnded::Outcome::kFailed; });
  const std::string where = fmt::format("on worker {} after {:.1f} s", last.worker, absl::ToDoubleSeconds(last.lasted));
  switch (last.outcome) {
    case core::AttemptEnded::Outcome::kDone:
      if (failed == 0) return fmt::format("{} is done; it ended {}.", task, where);
      return fmt::format("{} is done; it ended {}, after {} failed {}.", task, where, failed, failed == 1 ? "attempt" : "attempts");
    case core::AttemptEnded::Outcome::kFailed:
      return fmt::format("{} did not end: {} of {} attempts failed, the last {}: {}: {}.", task, failed, attempts.size(), where,
                         core::Name(last.cause), last.message);
    case core::AttemptEnded::Outcome::kCancelled:
      break;
  }
  return fmt::format("{} was cancelled {}.", task, where);
}

}  // namespace

void Archive::NoteEnds(const Turn& turn, const std::set<std::string>& jobs) {
  for (const std::string& id : jobs) {
    const core::Job* job = core::FindJob(turn.state(), id);
    if (job && core::IsOver(*job)) catalogue_.NoteEnd(id, WallSeconds());
  }
}

void Archive::Changed(Turn& turn, const std::set<std::string>& jobs) {
  NoteEnds(turn, jobs);
  for (const std::string& id : jobs) {
    const core::Job* job = core::FindJob(turn.state(), id);
    const auto known = catalogue_.FindJob(id);
    if (!job || !known.ok() || (*known)->ended || !core::IsOver(*job)) continue;
    const auto summary = JobMessage(turn.state(), catalogue_, **known, FrameOutputs::kLeftOut);
    const auto whole = JobMessage(turn.state(), catalogue_, **known, FrameOutputs::kListed);
    if (!summary.ok() || !whole.ok()) continue;
    turn.Record(store::JobEnded{id, summary->SerializeAsString(), whole->SerializeAsString(), (*known)->ended_at});
    spdlog::info("job ended: job={} state={}", id, v1::State_Name(whole->state()));
    kept_.push_back({id, job->tasks.size()});
    kept_tasks_ += job->tasks.size();
    catalogue_.End(id);
  }
  ForgetOld(turn);
}

void Archive::ForgetOld(Turn& turn) {
  while (!kept_.empty() && (kept_tasks_ > kKeptTasks || kept_.size() > kKeptJobs)) {
    const Kept oldest = kept_.front();
    kept_.pop_front();
    kept_tasks_ -= oldest.tasks;
    const auto known = catalogue_.FindJob(oldest.job);
    // One that was tried again goes on, and comes back here when it ends.
    if (known.ok() && (*known)->ended) turn.Apply(core::JobForgotten{oldest.job});
  }
}

absl::StatusOr<v1::Output> FindEndedOutput(const Catalogue& catalogue, const std::string& job, const std::string& name) {
  ASSIGN_OR_RETURN(const v1::Job message, Read(catalogue, job));
  for (const v1::Output& output : message.outputs()) {
    if (output.name() == name) return output;
  }
  return absl::NotFoundError(fmt::format("{} has no output of that name; the names are those that the job's state lists", job));
}

absl::StatusOr<std::string> ExplainEnded(const Catalogue& catalogue, const std::string& job, const std::string& task) {
  ASSIGN_OR_RETURN(const v1::Job message, Read(catalogue, job));
  const std::string state = message.state() == v1::DONE ? "done" : message.state() == v1::FAILED ? "failed" : "cancelled";
  for (const v1::FailedTask& failure : message.failures()) {
    const bool meant = task.empty() ? message.state() == v1::FAILED : task == failure.label() || task == failure.task_id();
    if (meant && task.empty()) return fmt::format("{} failed: {}: {}.", job, failure.label(), failure.cause());
    if (meant) return fmt::format("{} failed: {}.", failure.label(), failure.cause());
  }
  if (task.empty()) return fmt::format("{} is {}.", job, state);
  return ExplainByAttempts(catalogue, job, task, state);
}

}  // namespace vorocast::server
