// SPDX-License-Identifier: AGPL-3.0-or-later
// The rest of a job is played through: its stages as they read one another, on so many slots as it gets.
#include "scheduler/core/forecast.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <map>
#include <optional>
#include <queue>

namespace vorocast::core {
namespace {

/// More tasks than this are played through in bundles.
constexpr double kPlayedMax = 1000;

std::int32_t Of(const KindCounts& counts, Phase phase) { return counts.phase[static_cast<std::size_t>(phase)]; }
std::int32_t Open(const Job& job, bool with_blocked) {
  std::int32_t open = 0;
  for (const KindCounts& counts : job.counts) {
    open += Of(counts, Phase::kReady) + Of(counts, Phase::kRunning) + (with_blocked ? Of(counts, Phase::kBlocked) : 0);
  }
  return open;
}

std::int32_t SlotsFor(const State& state, tasks::Kind kind) {
  std::int32_t slots = 0;
  for (const Worker& worker : state.workers) {
    if (worker.is_there() && !worker.health.set_aside && (worker.kinds & (1u << static_cast<unsigned>(kind)))) slots += worker.slots;
  }
  return slots;
}

/// Seconds of each kind's task in a take of so many frames, on one core with 5000 cells and 65 thousand points: only their proportions
/// matter, for kinds that the job has not measured yet.
double TypicalSeconds(tasks::Kind kind, std::int32_t frames) {
  switch (kind) {
    case tasks::Kind::kTessellate:
      return 1.1;
    case tasks::Kind::kTemplate:
      return 4;
    case tasks::Kind::kStretch:
      return 3;
    case tasks::Kind::kGuide:
      return 2 + 0.01 * frames;
    case tasks::Kind::kTrack:
      return 3;
    case tasks::Kind::kAssemble:
      return 0.03 * frames;
    case tasks::Kind::kSimulate:
      return 2 + 0.1 * frames;
    case tasks::Kind::kSheet:
      return 15;
    case tasks::Kind::kRender:
      return 5;
    case tasks::Kind::kEncode:
      return 0.3 * frames;
  }
  return 1;
}

/// How much slower than typical this job's tasks have been so far; nothing while none has been measured.
std::optional<double> Slowness(const std::vector<StageView>& stages, std::int32_t frames) {
  double measured = 0;
  double typical = 0;
  for (const StageView& stage : stages) {
    const std::int32_t computed = stage.done - stage.reused;
    if (stage.seconds_mean <= 0 || computed <= 0) continue;
    measured += computed * stage.seconds_mean;
    typical += computed * TypicalSeconds(stage.kind, frames);
  }
  if (typical <= 0) return std::nullopt;
  return measured / typical;
}

/// What a job would take now if it were alone.
double Demand(const Job& job) {
  if (job.paused || job.starts_nothing()) return job.at_work;
  const double open = Open(job, false);
  return job.terms.workers_max > 0 ? std::min<double>(open, job.terms.workers_max) : open;
}

struct Share {
  double slots = 0;
  double ahead = 0;  // tasks of other jobs that go before any of this one
};

/// By the rules of Transition::Choose: larger priorities first, users of one priority alike, and a user's jobs one after the other.
Share ShareOf(const State& state, const Job& job, double slots) {
  Share share{.slots = slots};
  std::map<std::string, double> users;
  double before = 0;
  const auto index = static_cast<JobIndex>(&job - state.jobs.data());
  for (JobIndex other = 0; other < state.jobs.size(); ++other) {
    const Job& of = state.jobs[other];
    const double demand = other == index ? 0 : Demand(of);
    if (demand <= 0) continue;
    if (of.priority > job.priority) {
      share.slots -= demand;
      share.ahead += Open(of, true);
    } else if (of.priority == job.priority && of.user == job.user && PlaceOf(of, other) < PlaceOf(job, index)) {
      before += demand;
      share.ahead += Open(of, true);
    } else if (of.priority == job.priority && of.user != job.user) {
      users[of.user] += demand;
    }
  }
  // Who wants less than an equal part leaves the rest to the others.
  std::vector<double> demands;
  for (const auto& [user, demand] : users) demands.push_back(demand);
  std::sort(demands.begin(), demands.end());
  double rest = std::max(0.0, share.slots);
  double sharers = static_cast<double>(demands.size()) + 1;
  for (const double demand : demands) rest -= std::min(demand, rest / sharers--);
  share.slots = std::max(0.0, rest - before);
  return share;
}

/// One kind's tasks that are left.
struct Part {
  double total = 0;
  double ended = 0;
  double waiting = 0;  // not begun
  double seconds = 0;  // each
  double slots = 0;    // of workers that can do it
  double busy = 0;
};

class Play {
 public:
  Play(const Job& job, double slots, double bundle) : job_(job), slots_(slots), bundle_(bundle) {}
  std::array<Part, kKinds> parts;

  void Begin(std::size_t kind, double seconds, double count) {
    parts[kind].busy += count;
    busy_ += count;
    ends_.push({now_ + seconds, kind, count});
  }
  double Run() {
    while (true) {
      BeginAll();
      if (ends_.empty()) return now_;
      const End end = ends_.top();
      ends_.pop();
      now_ = end.at;
      busy_ -= end.count;
      parts[end.kind].busy -= end.count;
      parts[end.kind].ended += end.count;
    }
  }

 private:
  struct End {
    double at = 0;
    std::size_t kind = 0;
    double count = 0;
    friend bool operator>(const End& a, const End& b) { return a.at > b.at; }
  };
  /// Tasks of one kind read those of another all at once, or each a part further on.
  bool MayBegin(std::size_t kind) const {
    const Part& part = parts[kind];
    for (std::size_t read = 0; read < kKinds; ++read) {
      if (job_.reads[kind][read] == 0 || read == kind) continue;
      const double of = parts[read].total;
      const double each = std::min(1.0, job_.reads[kind][read] / part.total / of);
      const double at = part.total > 1 ? (part.total - part.waiting) / (part.total - 1) : 0;
      if (parts[read].ended + 0.5 < of * std::min(1.0, each + (1 - each) * at)) return false;
    }
    return true;
  }
  void BeginAll() {
    for (std::size_t kind = 0; kind < kKinds; ++kind) {
      Part& part = parts[kind];
      while (part.waiting > 1e-9 && busy_ < slots_ - 1e-9 && part.busy < part.slots - 1e-9 && MayBegin(kind)) {
        const double count = std::min({part.waiting, bundle_, slots_ - busy_, part.slots - part.busy});
        part.waiting -= count;
        Begin(kind, part.seconds, count);
      }
    }
  }

  const Job& job_;
  const double slots_;
  const double bundle_;
  double now_ = 0;
  double busy_ = 0;
  std::priority_queue<End, std::vector<End>, std::greater<>> ends_;
};

}  // namespace

double SecondsLeft(const State& state, const Job& job, const std::vector<StageView>& stages) {
  if (!job.complete || job.paused) return -1;
  const std::int32_t frames = stages.empty() ? 0 : stages.front().total;
  const std::optional<double> slowness = Slowness(stages, frames);
  std::array<Part, kKinds> parts;
  double most_slots = 0;
  double left = 0;
  double work = 0;
  for (const StageView& stage : stages) {
    const auto kind = static_cast<std::size_t>(stage.kind);
    Part& part = parts[kind];
    part.total = stage.total;
    part.ended = stage.done + stage.failed + stage.cancelled;
    part.waiting = stage.total - part.ended - stage.running;
    if (part.waiting + stage.running <= 0) continue;
    part.slots = SlotsFor(state, stage.kind);
    if (part.slots == 0) return -1;
    if (stage.seconds_mean <= 0 && !slowness) return -1;
    part.seconds = stage.seconds_mean > 0 ? stage.seconds_mean : *slowness * TypicalSeconds(stage.kind, frames);
    most_slots = std::max(most_slots, part.slots);
    left += part.waiting;
    work += part.waiting * part.seconds;
  }
  Share share = ShareOf(state, job, most_slots);
  if (job.terms.workers_max > 0) share.slots = std::min<double>(share.slots, job.terms.workers_max);
  // With nothing to itself it waits until those before it are through; their tasks are taken to be like its own.
  double wait = 0;
  if (share.slots < 1 && job.running.empty() && left > 0) {
    wait = share.ahead * (work / left) / most_slots;
    share.slots = job.terms.workers_max > 0 ? std::min<double>(most_slots, job.terms.workers_max) : most_slots;
  }
  share.slots = std::max({share.slots, 1.0, static_cast<double>(job.running.size())});
  Play play(job, share.slots, std::max(1.0, left / kPlayedMax));
  play.parts = parts;
  for (const TaskIndex index : job.running) {
    const Task& task = state.tasks[index];
    const Attempt& attempt = std::get<Leased>(state.runs[std::get<Wanted>(task.state).run].state).attempts.front();
    const auto kind = static_cast<std::size_t>(task.kind);
    const double elapsed = absl::ToDoubleSeconds(state.last_tick - attempt.started);
    const double of_mean = std::clamp(elapsed / parts[kind].seconds, 0.0, 0.95);
    play.Begin(kind, parts[kind].seconds * (1 - std::max(of_mean, attempt.fraction)), 1);
  }
  return wait + play.Run();
}

}  // namespace vorocast::core
