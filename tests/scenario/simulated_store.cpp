// SPDX-License-Identifier: AGPL-3.0-or-later
#include "tests/scenario/simulated_store.h"

#include <algorithm>
#include <iterator>

#include <fmt/format.h>

namespace vorocast::scenario {
namespace {

struct Writer {
  SimulatedStore& store;

  SimulatedStore::SubmittedJob& Job(const std::string& id) const {
    return *std::find_if(store.jobs.begin(), store.jobs.end(), [&](const SimulatedStore::SubmittedJob& job) { return job.id == id; });
  }
  void operator()(const core::ResultMade& made) const { store.results[made.key] = made.result; }
  void operator()(const core::TaskFailed& failed) const { Job(failed.job).failures[failed.task] = failed; }
  void operator()(const core::RunSaved& saved) const { store.runs[saved.key] = saved; }
  void operator()(const core::RunEnded& ended) const { store.runs.erase(ended.key); }
  void operator()(const core::AttemptsReserved& reserved) const { store.attempt_next = reserved.next; }
  void operator()(const core::JobCancelled& cancelled) const { Job(cancelled.job).cancelled = true; }
  void operator()(const core::AttemptEnded&) const {}
  void operator()(const core::JobRetried& retried) const {
    Job(retried.job).cancelled = false;
    Job(retried.job).failures.clear();
  }
  void operator()(const core::JobPaused& paused) const { Job(paused.job).paused = paused.paused; }
  void operator()(const core::JobLimited& limited) const {
    Job(limited.job).terms.memory_limit = limited.memory_limit;
    Job(limited.job).terms.time_factor = limited.time_factor;
  }
};

}  // namespace

absl::Status SimulatedStore::Append(std::int64_t under_term, const std::vector<core::Record>& records) {
  if (under_term != term) return absl::FailedPreconditionError(fmt::format("another scheduler leads under term {}", term));
  for (const core::Record& record : records) std::visit(Writer{*this}, record);
  return absl::OkStatus();
}

std::string SimulatedStore::Text() const {
  std::string text = fmt::format("term {} attempts {}\n", term, attempt_next);
  const auto add = std::back_inserter(text);
  for (const SubmittedJob& job : jobs) {
    fmt::format_to(add, "{} {} {} {} {}\n", job.id, job.cancelled, job.paused, job.terms.memory_limit, job.terms.time_factor);
    for (const auto& [task, failure] : job.failures) fmt::format_to(add, "{} {} {}\n", task, core::Name(failure.cause), failure.message);
  }
  for (const auto& [key, result] : results) fmt::format_to(add, "{} {} {}\n", key.Hex(), result.sha256.Hex(), result.made_for);
  for (const auto& [key, run] : runs) {
    fmt::format_to(add, "{} {} {} {} {} {} {} {} {}\n", key.Hex(), run.attempt, run.worker, run.tries.failed, run.tries.interrupted,
                   run.tries.memory_raised, run.tries.time_raised, run.copy_attempt, run.copy_worker);
  }
  return text;
}

}  // namespace vorocast::scenario
