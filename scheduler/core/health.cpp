// SPDX-License-Identifier: AGPL-3.0-or-later
// A worker that fails many different tasks which others could do is set aside for a while: a full or read-only disk, a bad library, broken memory.
// It would fail fast, so it would get the next task at once, and could go through the attempts of a whole queue.
#include <algorithm>
#include <set>

#include <fmt/format.h>

#include "scheduler/core/transition.h"

namespace vorocast::core {
namespace {

constexpr std::size_t kTrialsKept = 16;
/// So many different tasks failed among those trials set a worker aside.
constexpr std::size_t kFailedRunsMax = 4;
constexpr absl::Duration kRestFirst = absl::Minutes(5);
constexpr absl::Duration kRestLast = absl::Hours(1);
/// On probation so many successes in a row clear a worker.
constexpr std::int32_t kProbationSuccesses = 3;
/// For so long others go first at a task that a worker failed.
constexpr absl::Duration kAvoidFor = absl::Seconds(30);

std::uint64_t Head(const base::Digest& key) {
  std::uint64_t head = 0;
  for (std::size_t i = 0; i < sizeof head; ++i) head = head << 8 | key.bytes[i];
  return head;
}

void Note(Health& health, Health::Trial trial) {
  if (health.trials.size() == kTrialsKept) health.trials.erase(health.trials.begin());
  health.trials.push_back(trial);
}

}  // namespace

bool Transition::IsAvoided(const Run& run, const Worker& worker) const {
  return now_ < run.avoid_until && std::find(run.failed_on.begin(), run.failed_on.end(), worker.serial) != run.failed_on.end();
}

bool Transition::IsSuspect(const Worker& worker) const {
  std::set<std::uint64_t> failed;
  for (const Health::Trial& trial : worker.health.trials) {
    if (trial.failed) failed.insert(trial.run);
  }
  return failed.size() >= kFailedRunsMax;
}

bool Transition::AreOthersSound(WorkerIndex index) const {
  std::uint32_t kinds = 0;
  bool any_succeeded = false;
  for (WorkerIndex other = 0; other < state_.workers.size(); ++other) {
    const Worker& worker = state_.workers[other];
    if (other == index || !worker.is_there() || worker.health.set_aside || IsSuspect(worker)) continue;
    kinds |= worker.kinds;
    const auto succeeded = [](const Health::Trial& trial) { return !trial.failed; };
    any_succeeded = any_succeeded || ((worker.kinds & state_.workers[index].kinds) != 0 &&
                                      std::any_of(worker.health.trials.begin(), worker.health.trials.end(), succeeded));
  }
  return any_succeeded && (state_.workers[index].kinds & ~kinds) == 0;
}

void Transition::NoteSuccess(const Run& run, WorkerIndex index) {
  Worker& worker = state_.workers[index];
  Note(worker.health, {Head(run.key), false});
  if (!worker.health.on_probation || ++worker.health.successes < kProbationSuccesses) return;
  Delist(index);
  worker.health = Health{.trials = std::move(worker.health.trials)};
  Enlist(index);
}

void Transition::NoteFailure(Run& run, WorkerIndex index) {
  Worker& worker = state_.workers[index];
  const std::uint64_t head = Head(run.key);
  // What fails with several workers is not held against any of them.
  bool failed_elsewhere = false;
  for (Worker& other : state_.workers) {
    if (&other == &worker || run.failed_on.empty()) continue;
    if (std::find(run.failed_on.begin(), run.failed_on.end(), other.serial) == run.failed_on.end()) continue;
    failed_elsewhere = true;
    std::erase_if(other.health.trials, [head](const Health::Trial& trial) { return trial.failed && trial.run == head; });
  }
  if (std::find(run.failed_on.begin(), run.failed_on.end(), worker.serial) == run.failed_on.end()) run.failed_on.push_back(worker.serial);
  run.avoid_until = now_ + kAvoidFor;
  if (failed_elsewhere) return;
  Note(worker.health, {head, true});
  worker.health.successes = 0;
  if (worker.health.set_aside || !(worker.health.on_probation || IsSuspect(worker))) return;
  if (AreOthersSound(index)) return SetAside(index);
  workers_changed_ = true;  // if the others are no better, whoever was set aside before comes back
}

void Transition::SetAside(WorkerIndex index) {
  Worker& worker = state_.workers[index];
  Delist(index);
  std::set<std::uint64_t> failed;
  for (const Health::Trial& trial : worker.health.trials) {
    if (trial.failed) failed.insert(trial.run);
  }
  Health& health = worker.health;
  health.reason = health.on_probation
                      ? "it failed again after a rest"
                      : fmt::format("it failed {} different tasks of its last {}, and other workers do well", failed.size(), health.trials.size());
  const absl::Duration rest = std::min(kRestFirst * (1 << std::min(health.rests, 10)), kRestLast);
  health.set_aside = true;
  health.on_probation = false;
  health.until = now_ + rest;
  ++health.rests;
  health.trials.clear();
  state_.set_aside.insert({health.until, index});
  workers_changed_ = true;
}

void Transition::EndRests() {
  while (!state_.set_aside.empty() && state_.set_aside.begin()->first <= now_) {
    const WorkerIndex index = state_.set_aside.begin()->second;
    state_.set_aside.erase(state_.set_aside.begin());
    Health& health = state_.workers[index].health;
    health.set_aside = false;
    health.on_probation = true;
    health.successes = 0;
    Enlist(index);
    absent_.push_back(index);
  }
}

void Transition::TakeBackTheLast() {
  std::uint32_t kinds = 0;
  bool any_sound = false;
  for (const Worker& worker : state_.workers) {
    if (!worker.is_there() || worker.health.set_aside) continue;
    kinds |= worker.kinds;
    any_sound = any_sound || !IsSuspect(worker);
  }
  if (!any_sound) kinds = 0;
  for (const auto& [until, index] : std::set(state_.set_aside)) {
    Worker& worker = state_.workers[index];
    if (worker.connection == 0 || (worker.kinds & ~kinds) == 0) continue;
    state_.set_aside.erase({until, index});
    worker.health = Health{};
    Enlist(index);
  }
}

}  // namespace vorocast::core
