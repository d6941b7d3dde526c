// SPDX-License-Identifier: AGPL-3.0-or-later
#include "scheduler/core/job_view.h"

#include <algorithm>

#include <fmt/format.h>

#include "scheduler/core/forecast.h"

namespace vorocast::core {
namespace {

std::int32_t Of(const KindCounts& counts, Phase phase) { return counts.phase[static_cast<std::size_t>(phase)]; }
std::int32_t Total(const Job& job, Phase phase) {
  std::int32_t total = 0;
  for (const KindCounts& counts : job.counts) total += Of(counts, phase);
  return total;
}

}  // namespace

Phase PhaseOf(const Job& job) {
  const bool open = Total(job, Phase::kBlocked) + Total(job, Phase::kReady) + Total(job, Phase::kRunning) > 0;
  if (open) return Phase::kRunning;
  if (job.cancelled) return Phase::kCancelled;
  if (job.stopped) return Phase::kFailed;
  if (!job.complete) return job.tasks.empty() ? Phase::kBlocked : Phase::kRunning;
  // A bad frame costs that frame, not the job; beyond the limit the job has been stopped.
  return Total(job, Phase::kFailed) > job.bad_frames ? Phase::kFailed : Phase::kDone;
}

JobView View(const State& state, const Job& job) {
  JobView view;
  view.phase = PhaseOf(job);
  std::array<double, kKinds> running{};
  for (const TaskIndex index : job.running) {
    const Task& task = state.tasks[index];
    double furthest = 0;
    for (const Attempt& attempt : std::get<Leased>(state.runs[std::get<Wanted>(task.state).run].state).attempts) {
      furthest = std::max(furthest, attempt.fraction);
    }
    running[static_cast<std::size_t>(task.kind)] += furthest;
  }
  for (const tasks::Kind kind : tasks::kAllKinds) {
    const KindCounts& counts = job.counts[static_cast<std::size_t>(kind)];
    StageView stage{.kind = kind};
    for (const std::int32_t count : counts.phase) stage.total += count;
    if (stage.total == 0) continue;
    stage.done = Of(counts, Phase::kDone);
    stage.reused = counts.reused;
    stage.running = Of(counts, Phase::kRunning);
    stage.failed = Of(counts, Phase::kFailed);
    stage.cancelled = Of(counts, Phase::kCancelled);
    stage.seconds_mean = counts.measured > 0 ? counts.seconds / counts.measured : 0;
    stage.fraction = (stage.done + running[static_cast<std::size_t>(kind)]) / stage.total;
    view.stages.push_back(stage);
  }
  if (job.stopped) view.failures.push_back({.label = job.name, .cause = *job.stopped});
  for (const TaskIndex index : job.failed) {
    if (view.failures.size() >= kFailuresShown) break;
    const Task& task = state.tasks[index];
    const auto& failed = std::get<Failed>(task.state);
    view.failures.push_back({TaskId(job, task), task.name, fmt::format("{}: {}", Name(failed.cause), failed.message)});
  }
  view.seconds_left = view.phase == Phase::kRunning ? SecondsLeft(state, job, view.stages) : 0;
  return view;
}

std::vector<OutputView> Outputs(const State& state, const Job& job, bool with_frames) {
  std::vector<OutputView> outputs;
  for (const TaskIndex index : job.tasks) {
    const Task& task = state.tasks[index];
    const auto* done = std::get_if<Done>(&task.state);
    if (!done || task.output.empty() || (!with_frames && task.kind == tasks::Kind::kTessellate)) continue;
    outputs.push_back({task.output, done->key, done->result, std::string(tasks::Extension(task.kind))});
  }
  return outputs;
}

absl::StatusOr<OutputView> FindOutput(const State& state, const Job& job, const std::string& name) {
  for (const TaskIndex index : job.tasks) {
    const Task& task = state.tasks[index];
    if (task.output != name || name.empty()) continue;
    if (const auto* done = std::get_if<Done>(&task.state))
      return OutputView{task.output, done->key, done->result, std::string(tasks::Extension(task.kind))};
    return absl::NotFoundError(fmt::format("{} is not there yet: {}", name, *Explain(state, job, task.name)));
  }
  return absl::NotFoundError(fmt::format("{} has no output of that name; the names are those that the job's state lists", job.id));
}

std::string TaskId(const Job& job, const Task& task) { return fmt::format("{}/{}", job.id, task.name); }

}  // namespace vorocast::core
