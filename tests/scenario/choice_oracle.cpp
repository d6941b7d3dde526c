// SPDX-License-Identifier: AGPL-3.0-or-later
#include "tests/scenario/choice_oracle.h"

#include <limits>
#include <map>
#include <optional>
#include <tuple>

#include <fmt/format.h>

namespace vorocast::scenario {
namespace {

/// The attempts that there were when `until` was given out.
struct Moment {
  const core::State& state;
  std::int64_t until;

  template <typename See>
  void ForEachAttempt(const See& see) const {
    for (const auto& [key, index] : state.run_by_key) {
      const auto* leased = std::get_if<core::Leased>(&state.runs[index].state);
      if (!leased) continue;
      for (const core::Attempt& attempt : leased->attempts) {
        if (attempt.number < until) see(index, attempt);
      }
    }
  }
  std::int32_t SlotsOfUser(const std::string& user) const {
    std::int32_t slots = 0;
    ForEachAttempt([&](core::RunIndex, const core::Attempt& a) { slots += a.job != core::kNone && state.jobs[a.job].user == user; });
    return slots;
  }
  std::int32_t SlotsOfJob(core::JobIndex job) const {
    std::int32_t slots = 0;
    ForEachAttempt([&](core::RunIndex, const core::Attempt& a) { slots += a.job == job; });
    return slots;
  }
  bool IsReady(core::RunIndex index) const {
    const core::Run& run = state.runs[index];
    if (std::holds_alternative<core::Ready>(run.state)) return true;
    const auto* leased = std::get_if<core::Leased>(&run.state);
    return leased && leased->attempts.front().number >= until;
  }
};

using Rank = std::tuple<std::int32_t, std::int32_t, double, core::JobIndex, core::TaskIndex, core::RunIndex>;

std::optional<Rank> Best(const Moment& moment, std::uint32_t kinds) {
  const core::State& state = moment.state;
  std::optional<Rank> best;
  for (const auto& [key, index] : state.run_by_key) {
    const core::Run& run = state.runs[index];
    if (!(kinds & (1u << static_cast<unsigned>(run.kind))) || !moment.IsReady(index)) continue;
    for (const core::TaskIndex task : run.tasks) {
      const core::JobIndex of = state.tasks[task].job;
      const core::Job& job = state.jobs[of];
      if (job.paused || job.cancelled || job.stopped) continue;
      if (job.terms.workers_max > 0 && moment.SlotsOfJob(of) >= job.terms.workers_max) continue;
      const double deadline = job.terms.deadline > 0 ? job.terms.deadline : std::numeric_limits<double>::infinity();
      const Rank rank{-job.priority, moment.SlotsOfUser(job.user), deadline, of, task, index};
      if (!best || rank < *best) best = rank;
    }
  }
  return best;
}

}  // namespace

absl::Status CheckChoices(const core::State& state, std::int64_t attempt_next) {
  for (std::int64_t number = attempt_next; number < state.attempt_next; ++number) {
    const Moment moment{state, number};
    core::RunIndex given = core::kNone;
    core::Attempt attempt;
    Moment{state, number + 1}.ForEachAttempt([&](core::RunIndex run, const core::Attempt& seen) {
      if (seen.number == number) given = run, attempt = seen;
    });
    if (given == core::kNone) return absl::InternalError(fmt::format("attempt {} was given to nobody", number));
    const auto best = Best(moment, state.workers[attempt.worker].kinds);
    const auto& attempts = std::get<core::Leased>(state.runs[given].state).attempts;
    if (attempts.front().number != number) {
      if (best) return absl::InternalError(fmt::format("a second attempt at run {} while run {} waits", given, std::get<5>(*best)));
      continue;
    }
    if (!best || std::get<5>(*best) != given || std::get<3>(*best) != attempt.job) {
      return absl::InternalError(fmt::format("attempt {} went to run {} of job {}; the rules say run {} of job {}", number, given, attempt.job,
                                             best ? std::get<5>(*best) : core::kNone, best ? std::get<3>(*best) : core::kNone));
    }
  }
  return absl::OkStatus();
}

}  // namespace vorocast::scenario
