// SPDX-License-Identifier: AGPL-3.0-or-later
#include "scheduler/server/archive.h"

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
    if (meant) return fmt::format("{} failed: {}: {}.", job, failure.label(), failure.cause());
  }
  if (task.empty()) return fmt::format("{} is {}.", job, state);
  return fmt::format("{} ended a while ago and is {}; of its tasks only the failures are kept, and \"{}\" is none of them.", job, state, task);
}

}  // namespace vorocast::server
