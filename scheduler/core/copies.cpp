// SPDX-License-Identifier: AGPL-3.0-or-later
// Near the end of a stage the slowest task decides when the next stage begins. Workers that would do nothing then take a second attempt at it.
#include <algorithm>

#include "scheduler/core/transition.h"

namespace vorocast::core {
namespace {

/// So many times the median of its kind in its job a task may take before it is copied.
constexpr double kOverdue = 2;
/// What is done sooner is not worth a message.
constexpr double kShortestS = 2;

}  // namespace

double Transition::Overdue(const Run& run, const Attempt& attempt) const {
  if (run.tasks.empty()) return 0;
  const Job& job = state_.jobs[state_.tasks[First(run)].job];
  const double median = job.recent[static_cast<std::size_t>(run.kind)].Median();
  const double elapsed = absl::ToDoubleSeconds(now_ - attempt.started);
  if (median <= 0 || elapsed < std::max(kOverdue * median, kShortestS)) return 0;
  // One that is nearly there would win against its copy.
  const bool soon = attempt.fraction > 0 && elapsed * (1 - attempt.fraction) < median * attempt.fraction;
  return soon ? 0 : elapsed / median;
}

void Transition::CopyStragglers() {
  const auto is_idle = [](const auto& of_kinds) { return !of_kinds.second.empty(); };
  if (std::none_of(state_.idle.begin(), state_.idle.end(), is_idle)) return;
  std::vector<std::pair<double, RunIndex>> late;
  for (const auto& [deadline, index, number] : state_.deadlines) {
    const auto* leased = std::get_if<Leased>(&state_.runs[index].state);
    if (!leased || leased->attempts.size() != 1) continue;
    if (const double overdue = Overdue(state_.runs[index], leased->attempts.front()); overdue > 0) late.emplace_back(-overdue, index);
  }
  std::sort(late.begin(), late.end());
  for (const auto& [overdue, index] : late) {
    Run& run = state_.runs[index];
    const JobIndex job = JobToCharge(run);
    if (job == kNone || state_.jobs[job].paused) continue;
    const WorkerIndex held_by = std::get<Leased>(run.state).attempts.front().worker;
    WorkerIndex chosen = kNone;
    for (const auto& [kinds, idle] : state_.idle) {
      if (chosen != kNone || !(kinds & (1u << static_cast<unsigned>(run.kind)))) continue;
      for (const auto& [free, worker] : idle) {
        if (worker == held_by || IsAvoided(run, state_.workers[worker])) continue;
        chosen = worker;
        break;
      }
    }
    if (chosen == kNone) continue;
    const Attempt copy{.number = NextAttempt(),
                       .worker = chosen,
                       .deadline = now_ + state_.settings.lease,
                       .started = now_,
                       .job = job,
                       .memory_raised = run.tries.memory_raised,
                       .time_raised = run.tries.time_raised};
    Unlist(index);
    std::get<Leased>(run.state).attempts.push_back(copy);
    List(index);
    Save(run);
    SendLease(run, copy);
    for (const TaskIndex task : run.tasks) Changed(state_.tasks[task].job);
  }
}

}  // namespace vorocast::core
