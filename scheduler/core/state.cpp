// SPDX-License-Identifier: AGPL-3.0-or-later
#include "scheduler/core/state.h"

#include <algorithm>
#include <limits>

#include "services/base/check.h"

namespace vorocast::core {
namespace {

Phase PhaseOf(const Run& run) { return std::holds_alternative<Leased>(run.state) ? Phase::kRunning : Phase::kReady; }

}  // namespace

Phase PhaseOf(const State& state, const Task& task) {
  struct Visitor {
    const State& state;
    Phase operator()(const Blocked&) const { return Phase::kBlocked; }
    Phase operator()(const Wanted& wanted) const { return PhaseOf(state.runs[wanted.run]); }
    Phase operator()(const Done&) const { return Phase::kDone; }
    Phase operator()(const Failed&) const { return Phase::kFailed; }
    Phase operator()(const Cancelled&) const { return Phase::kCancelled; }
  };
  return std::visit(Visitor{state}, task.state);
}

tasks::TaskSpec SpecOf(const State& state, const Task& task) {
  tasks::TaskSpec spec{.kind = task.kind, .options = *task.options};
  spec.inputs.reserve(task.inputs.size());
  for (const TaskInput& input : task.inputs) {
    tasks::Input& named = spec.inputs.emplace_back();
    named.role = input.role;
    named.frame = input.frame;
    named.extension = input.extension;
    named.source = input.task == kNone ? tasks::Input::Source::kBlob : tasks::Input::Source::kArtifact;
    if (input.task == kNone) {
      named.digest = input.blob;
      continue;
    }
    const Task& maker = state.tasks[input.task];
    VOROCAST_CHECK(HasEnded(maker));
    if (const auto* done = std::get_if<Done>(&maker.state)) {
      named.digest = done->key;
      named.content = done->result.sha256;
    }
  }
  return spec;
}

void RecentTimes::Add(double value) {
  if (!(value > 0)) return;
  if (seconds.size() < kKept) return seconds.push_back(static_cast<float>(value));
  seconds[next] = static_cast<float>(value);
  next = (next + 1) % kKept;
}

double RecentTimes::Median() const {
  constexpr std::size_t kEnough = 5;
  if (seconds.size() < kEnough) return 0;
  std::vector<float> sorted = seconds;
  const auto middle = sorted.begin() + static_cast<std::ptrdiff_t>(sorted.size() / 2);
  std::nth_element(sorted.begin(), middle, sorted.end());
  return *middle;
}

JobPlace PlaceOf(const Job& job, JobIndex index) {
  return {job.terms.deadline > 0 ? job.terms.deadline : std::numeric_limits<double>::infinity(), index};
}

bool IsOver(const Job& job) {
  constexpr Phase kOpen[] = {Phase::kBlocked, Phase::kReady, Phase::kRunning};
  for (const KindCounts& counts : job.counts) {
    for (const Phase phase : kOpen) {
      if (counts.phase[static_cast<std::size_t>(phase)] > 0) return false;
    }
  }
  return job.complete;
}

const Job* FindJob(const State& state, const std::string& id) {
  const auto found = state.job_by_id.find(id);
  return found == state.job_by_id.end() ? nullptr : &state.jobs[found->second];
}

}  // namespace vorocast::core
