// SPDX-License-Identifier: AGPL-3.0-or-later
#include "scheduler/server/collector.h"

#include <algorithm>
#include <chrono>
#include <future>
#include <utility>

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include "services/base/status.h"

namespace vorocast::server {
namespace {

/// Old attempts go little by little: some milliseconds of the store's time a minute, nearly three million a day.
constexpr absl::Duration kForgetEvery = absl::Minutes(1);
constexpr std::int64_t kForgottenAtOnce = 2000;
constexpr auto kPatience = std::chrono::seconds(30);
/// A turn looks at so many tasks: a millisecond or two.
constexpr std::size_t kTasksATurn = 5000;
constexpr std::size_t kLinesARound = 1000;

const char* WhyText(Collected::Why why) { return why == Collected::Why::kOld ? "old" : "disk limit"; }

void NoteTask(const core::State& state, const core::Task& task, InUse& in_use) {
  if (const auto* done = std::get_if<core::Done>(&task.state)) in_use.results.insert(done->key);
  if (const auto* wanted = std::get_if<core::Wanted>(&task.state)) in_use.results.insert(state.runs[wanted->run].key);
  for (const core::TaskInput& input : task.inputs) {
    if (input.task == core::kNone) in_use.blobs.insert(input.blob);
  }
}

}  // namespace

Collector::Collector(Engine& engine, const Catalogue& catalogue, const storage::ArtifactStore& artifacts, SchedulerMetrics& metrics,
                     CollectorOptions options)
    : engine_(engine), catalogue_(catalogue), artifacts_(artifacts), metrics_(metrics), options_(std::move(options)), thread_([this] { Loop(); }) {}

Collector::~Collector() {
  {
    const std::lock_guard lock(mutex_);
    stopping_ = true;
  }
  wake_.notify_all();
  thread_.join();
}

bool Collector::stopping() {
  const std::lock_guard lock(mutex_);
  return stopping_;
}

void Collector::Loop() {
  storage::EmptyTrash(artifacts_);
  absl::Time next_round = MonotonicNow() + options_.every;
  while (true) {
    {
      std::unique_lock lock(mutex_);
      if (wake_.wait_for(lock, absl::ToChronoMilliseconds(std::min(kForgetEvery, options_.every)), [this] { return stopping_; })) return;
    }
    ForgetAttempts();
    if (!options_.policy.asked_for() || MonotonicNow() < next_round) continue;
    next_round = MonotonicNow() + options_.every;
    if (const auto plan = Collect(); !plan.ok()) spdlog::warn("collection put off: reason=\"{}\"", std::string(plan.status().message()));
  }
}

void Collector::ForgetAttempts() {
  if (options_.keep_attempts == absl::InfiniteDuration()) return;
  engine_.Submit([before = options_.now() - options_.keep_attempts](Turn& turn) { turn.Record(store::AttemptsForgotten{before, kForgottenAtOnce}); });
}

absl::Status Collector::InTurn(std::function<void(Turn&)> work) {
  const auto ended = std::make_shared<std::promise<void>>();
  std::future<void> end = ended->get_future();
  RETURN_IF_ERROR(engine_.Ask([work = std::move(work), ended](Turn& turn) {
    work(turn);
    ended->set_value();
  }));
  if (end.wait_for(kPatience) == std::future_status::ready) return absl::OkStatus();
  return absl::UnavailableError("the scheduler has been too busy to say what unfinished jobs read");
}

absl::StatusOr<InUse> Collector::AskInUse() {
  // Shared with the turns, which may come when this has given up waiting.
  struct Answer {
    InUse in_use;
    bool planning = false;
    std::size_t job = 0;
    std::size_t task = 0;  // of that job, the next to look at
    bool over = false;
  };
  const auto answer = std::make_shared<Answer>();
  RETURN_IF_ERROR(InTurn([this, answer](Turn&) {
    answer->planning = catalogue_.is_planning();
    catalogue_.AddFramesInUse(answer->in_use.blobs);
  }));
  while (!answer->over && !answer->planning) {
    if (stopping()) return absl::UnavailableError("the scheduler is stopping");
    RETURN_IF_ERROR(InTurn([answer](Turn& turn) {
      const core::State& state = turn.state();
      std::size_t looked = 0;
      for (; answer->job < state.jobs.size(); ++answer->job, answer->task = 0) {
        const core::Job& job = state.jobs[answer->job];
        if (job.id.empty() || core::IsOver(job)) continue;
        for (; answer->task < job.tasks.size(); ++answer->task) {
          if (++looked > kTasksATurn) return;
          NoteTask(state, state.tasks[job.tasks[answer->task]], answer->in_use);
        }
      }
      answer->over = true;
    }));
  }
  if (answer->planning) return absl::UnavailableError("jobs are still being planned");
  return std::move(answer->in_use);
}

absl::StatusOr<CollectionPlan> Collector::Collect() {
  ASSIGN_OR_RETURN(std::vector<storage::StoredFile> files, storage::ListStored(artifacts_, [this] { return stopping(); }));
  ASSIGN_OR_RETURN(const InUse in_use, AskInUse());
  CollectionPlan plan = PlanCollection(std::move(files), in_use, options_.policy, options_.now());
  if (!options_.dry_run) Remove(plan);
  for (std::size_t i = 0; i < std::min(plan.remove.size(), kLinesARound); ++i) {
    const Collected& gone = plan.remove[i];
    spdlog::info("{}: {}={}{} bytes={} used={} why=\"{}\"", options_.dry_run ? "would be collected" : "collected",
                 gone.file.what == storage::StoredFile::What::kBlob ? "blob" : "result", gone.file.digest.Hex(), gone.file.extension, gone.file.size,
                 absl::FormatTime("%Y-%m-%dT%H:%M:%SZ", gone.file.used, absl::UTCTimeZone()), WhyText(gone.why));
  }
  spdlog::info("collection: {}_files={} {}_bytes={} in_use_bytes={} left_bytes={}", options_.dry_run ? "removable" : "removed", plan.remove.size(),
               options_.dry_run ? "removable" : "removed", plan.bytes, plan.bytes_in_use, plan.bytes_before - (options_.dry_run ? 0 : plan.bytes));
  if (options_.policy.disk_limit > 0 && plan.bytes_before - plan.bytes > options_.policy.disk_limit) {
    spdlog::warn("collection: more than the disk limit is in use or too young to go: left_bytes={} disk_limit={}", plan.bytes_before - plan.bytes,
                 options_.policy.disk_limit);
  }
  metrics_.SetStored(plan.bytes_before - (options_.dry_run ? 0 : plan.bytes));
  return plan;
}

void Collector::Remove(CollectionPlan& plan) {
  std::vector<Collected> removed;
  plan.bytes = 0;
  for (Collected& chosen : plan.remove) {
    if (stopping()) break;
    const auto went = storage::Discard(artifacts_, chosen.file);
    if (!went.ok()) {
      spdlog::error("collection stopped: error=\"{}\"", std::string(went.status().message()));
      break;
    }
    if (!*went) continue;
    plan.bytes += chosen.file.size;
    removed.push_back(std::move(chosen));
  }
  plan.remove = std::move(removed);
  metrics_.Collected(static_cast<std::int64_t>(plan.remove.size()), plan.bytes);
}

}  // namespace vorocast::server
