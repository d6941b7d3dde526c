// SPDX-License-Identifier: AGPL-3.0-or-later
#include "scheduler/server/scheduler_metrics.h"

#include <string>
#include <variant>

#include "scheduler/core/job_view.h"
#include "services/telemetry/metrics_server.h"

namespace vorocast::server {
namespace {

constexpr absl::Duration kRefresh = absl::Seconds(1);
constexpr std::array<const char*, core::kPhases> kPhaseNames = {"blocked", "ready", "running", "done", "failed", "cancelled"};
/// From a small cell file to a simulation overnight.
const prometheus::Histogram::BucketBoundaries kTaskSeconds = {0.1, 0.2, 0.5, 1, 2, 5, 10, 20, 60, 180, 600, 1800, 7200, 36000};
const prometheus::Histogram::BucketBoundaries kCommitSeconds = {0.0005, 0.001, 0.002, 0.005, 0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1, 5};

prometheus::Gauge& AddGauge(prometheus::Registry& registry, const char* name, const char* help) {
  return prometheus::BuildGauge().Name(name).Help(help).Register(registry).Add({});
}
prometheus::Counter& AddCounter(prometheus::Registry& registry, const char* name, const char* help) {
  return prometheus::BuildCounter().Name(name).Help(help).Register(registry).Add({});
}

/// A label has few values: blanks would make queries awkward.
std::string Label(std::string_view text) {
  std::string label(text);
  for (char& c : label) {
    if (c == ' ') c = '_';
  }
  return label;
}

const char* OutcomeLabel(core::AttemptEnded::Outcome outcome) {
  switch (outcome) {
    case core::AttemptEnded::Outcome::kDone:
      return "done";
    case core::AttemptEnded::Outcome::kFailed:
      return "failed";
    case core::AttemptEnded::Outcome::kCancelled:
      break;
  }
  return "cancelled";
}

}  // namespace

SchedulerMetrics::SchedulerMetrics()
    : attempts_(prometheus::BuildCounter()
                    .Name("vorocast_attempts_total")
                    .Help("Attempts at tasks that ended, by outcome and by the cause of a failure")
                    .Register(*registry_)),
      workers_(AddGauge(*registry_, "vorocast_workers", "Workers that are connected")),
      slots_(AddGauge(*registry_, "vorocast_slots", "Tasks that the connected workers can run at once")),
      busy_(AddGauge(*registry_, "vorocast_busy_slots", "Tasks that the connected workers run now")),
      waiting_(AddGauge(*registry_, "vorocast_engine_waiting", "Commands that wait for the engine's thread")),
      term_(AddGauge(*registry_, "vorocast_leader_term", "The term under which this scheduler leads")),
      stored_bytes_(AddGauge(*registry_, "vorocast_stored_bytes", "Captured frames and results on disk, as last counted by the collector")),
      commit_seconds_(prometheus::BuildHistogram()
                          .Name("vorocast_commit_seconds")
                          .Help("Time until a batch of records was durable")
                          .Register(*registry_)
                          .Add({}, kCommitSeconds)),
      commit_records_(AddCounter(*registry_, "vorocast_commit_records_total", "Records that were made durable")),
      stalls_(AddCounter(*registry_, "vorocast_store_stalls_total", "How often the store could not be written for a while")),
      upload_bytes_(AddCounter(*registry_, "vorocast_upload_bytes_total", "Bytes of captured frames that were taken in")),
      result_bytes_(AddCounter(*registry_, "vorocast_artifact_bytes_total", "Bytes of results that were made")),
      collected_files_(AddCounter(*registry_, "vorocast_collected_files_total", "Captured frames and results that were removed")),
      collected_bytes_(AddCounter(*registry_, "vorocast_collected_bytes_total", "Their bytes")) {
  telemetry::AddBuildInformation(*registry_, "scheduler");
  auto& tasks = prometheus::BuildGauge().Name("vorocast_tasks").Help("Tasks of jobs that have not ended, by kind and phase").Register(*registry_);
  auto& seconds = prometheus::BuildHistogram().Name("vorocast_task_seconds").Help("Wall clock of attempts that succeeded").Register(*registry_);
  for (const tasks::Kind kind : tasks::kAllKinds) {
    const auto k = static_cast<std::size_t>(kind);
    const std::string name(tasks::Name(kind));
    for (std::size_t phase = 0; phase < core::kPhases; ++phase) tasks_[k][phase] = &tasks.Add({{"kind", name}, {"phase", kPhaseNames[phase]}});
    task_seconds_[k] = &seconds.Add({{"kind", name}}, kTaskSeconds);
  }
  auto& jobs = prometheus::BuildGauge().Name("vorocast_jobs").Help("Jobs that have not ended, by phase").Register(*registry_);
  for (const core::Phase phase : {core::Phase::kBlocked, core::Phase::kReady, core::Phase::kRunning}) {
    const auto p = static_cast<std::size_t>(phase);
    jobs_[p] = &jobs.Add({{"phase", kPhaseNames[p]}});
  }
}

void SchedulerMetrics::Count(const core::AttemptEnded& ended) {
  const bool failed = ended.outcome == core::AttemptEnded::Outcome::kFailed;
  attempts_.Add({{"outcome", OutcomeLabel(ended.outcome)}, {"cause", failed ? Label(core::Name(ended.cause)) : "none"}}).Increment();
  if (ended.outcome == core::AttemptEnded::Outcome::kDone) {
    task_seconds_[static_cast<std::size_t>(ended.kind)]->Observe(absl::ToDoubleSeconds(ended.lasted));
  }
}

void SchedulerMetrics::Committed(const std::vector<store::Record>& records, absl::Duration took) {
  commit_seconds_.Observe(absl::ToDoubleSeconds(took));
  commit_records_.Increment(static_cast<double>(records.size()));
  for (const store::Record& record : records) {
    const auto* of_core = std::get_if<core::Record>(&record);
    if (!of_core) continue;
    if (const auto* ended = std::get_if<core::AttemptEnded>(of_core)) Count(*ended);
    if (const auto* made = std::get_if<core::ResultMade>(of_core)) result_bytes_.Increment(static_cast<double>(made->result.size));
  }
}

void SchedulerMetrics::Refresh(const core::State& state, std::size_t waiting, absl::Time now) {
  if (now - refreshed_ < kRefresh) return;
  refreshed_ = now;
  waiting_.Set(static_cast<double>(waiting));
  std::array<std::array<std::int64_t, core::kPhases>, core::kKinds> tasks{};
  std::array<std::int64_t, core::kPhases> jobs{};
  for (const core::Job& job : state.jobs) {
    if (job.id.empty() || core::IsOver(job)) continue;
    ++jobs[static_cast<std::size_t>(core::PhaseOf(job))];
    for (std::size_t kind = 0; kind < core::kKinds; ++kind) {
      for (std::size_t phase = 0; phase < core::kPhases; ++phase) tasks[kind][phase] += job.counts[kind].phase[phase];
    }
  }
  for (std::size_t kind = 0; kind < core::kKinds; ++kind) {
    for (std::size_t phase = 0; phase < core::kPhases; ++phase) tasks_[kind][phase]->Set(static_cast<double>(tasks[kind][phase]));
  }
  for (std::size_t phase = 0; phase < core::kPhases; ++phase) {
    if (jobs_[phase]) jobs_[phase]->Set(static_cast<double>(jobs[phase]));
  }
  std::int64_t workers = 0;
  std::int64_t slots = 0;
  std::int64_t busy = 0;
  for (const core::Worker& worker : state.workers) {
    if (worker.connection == 0) continue;
    ++workers;
    slots += worker.slots;
    busy += static_cast<std::int64_t>(worker.runs.size());
  }
  workers_.Set(static_cast<double>(workers));
  slots_.Set(static_cast<double>(slots));
  busy_.Set(static_cast<double>(busy));
}

void SchedulerMetrics::Collected(std::int64_t files, std::int64_t bytes) {
  collected_files_.Increment(static_cast<double>(files));
  collected_bytes_.Increment(static_cast<double>(bytes));
}

}  // namespace vorocast::server
