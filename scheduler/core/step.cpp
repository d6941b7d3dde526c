// SPDX-License-Identifier: AGPL-3.0-or-later
#include "scheduler/core/step.h"

#include "scheduler/core/transition.h"

namespace vorocast::core {

Effects Step(State& state, Event event, absl::Time now) {
  Effects effects;
  Transition transition(state, effects, now);
  std::visit([&transition](auto& happened) { transition.On(happened); }, event);
  transition.Settle();
  return effects;
}

void Transition::Settle() {
  FlowEndings();
  while (!to_stop_.empty()) {
    const JobIndex job = to_stop_.back();
    to_stop_.pop_back();
    if (state_.jobs[job].starts_nothing() || state_.jobs[job].has_too_many_bad_frames()) StopJob(job);
    FlowEndings();
  }
  if (workers_changed_ && !state_.set_aside.empty()) TakeBackTheLast();
  HandOut();
  if (copies_due_) CopyStragglers();
  ForgetAbsentWorkers();
  for (const JobIndex job : changed_) effects_.changed_jobs.push_back(state_.jobs[job].id);
}

}  // namespace vorocast::core
