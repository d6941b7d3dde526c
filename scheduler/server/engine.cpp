// SPDX-License-Identifier: AGPL-3.0-or-later
#include "scheduler/server/engine.h"

#include <algorithm>
#include <chrono>
#include <utility>

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include "absl/time/clock.h"
#include "scheduler/core/step.h"
#include "services/base/check.h"
#include "services/base/status.h"

namespace vorocast::server {
namespace {

constexpr std::size_t kQueueMax = 100'000;
/// So long a turn takes in commands: many share one commit, and an answer does not wait for an endless queue.
constexpr auto kTurnTime = std::chrono::milliseconds(10);
constexpr auto kTick = std::chrono::milliseconds(50);
constexpr auto kCommitPauseFirst = std::chrono::milliseconds(20);
constexpr auto kCommitPauseLast = std::chrono::milliseconds(500);
/// An engine that is told to stop tries that often to make its last turn durable.
constexpr int kLastAttempts = 5;
constexpr int kAttemptsALogLine = 20;

void Log(const core::Record& record) {
  if (const auto* failed = std::get_if<core::TaskFailed>(&record)) {
    spdlog::warn("task failed: job={} task=\"{}\" cause=\"{}\" message=\"{}\"", failed->job, failed->task, core::Name(failed->cause),
                 failed->message);
  }
}

}  // namespace

absl::Time MonotonicNow() {
  const auto since = std::chrono::steady_clock::now().time_since_epoch();
  return absl::UnixEpoch() + absl::FromChrono(since);
}

double WallSeconds() { return absl::ToDoubleSeconds(absl::Now() - absl::UnixEpoch()); }

void Turn::Apply(core::Event event) {
  core::Effects effects = core::Step(state_, std::move(event), now_);
  for (core::Record& record : effects.records) {
    if (auto* ended = std::get_if<core::AttemptEnded>(&record)) ended->ended = absl::Now();
    Log(record);
    records_.emplace_back(std::move(record));
  }
  std::move(effects.messages.begin(), effects.messages.end(), std::back_inserter(messages_));
  std::move(effects.look_ups.begin(), effects.look_ups.end(), std::back_inserter(look_ups_));
  changed_jobs_.insert(effects.changed_jobs.begin(), effects.changed_jobs.end());
}

void Engine::Prepare(const Command& command) {
  VOROCAST_CHECK(!thread_.joinable());
  Turn turn(state_, MonotonicNow());
  command(turn);
  VOROCAST_CHECK(turn.messages_.empty());
  if (!Commit(turn).ok()) return;
  for (const auto& action : turn.after_) action();
  std::move(turn.look_ups_.begin(), turn.look_ups_.end(), std::back_inserter(early_look_ups_));
}

void Engine::Start(EngineAdapters adapters) {
  adapters_ = std::move(adapters);
  if (!early_look_ups_.empty()) adapters_.look_up(std::exchange(early_look_ups_, {}));
  thread_ = std::thread([this] { Run(); });
}

void Engine::Stop() {
  {
    const std::lock_guard lock(mutex_);
    stopping_ = true;
  }
  wake_.notify_all();
  if (thread_.joinable()) thread_.join();
}

bool Engine::Submit(Command command) {
  {
    const std::lock_guard lock(mutex_);
    if (stopping_ || commands_.size() >= kQueueMax) return false;
    commands_.push_back(std::move(command));
  }
  wake_.notify_one();
  return true;
}

absl::Status Engine::Ask(Command command) {
  {
    const std::lock_guard lock(mutex_);
    if (!stalled_.ok()) return stalled_;
    if (stopping_ || asked_.size() >= kQueueMax) return absl::UnavailableError("the scheduler is stopping or overloaded; try again");
    asked_.push_back(std::move(command));
  }
  wake_.notify_one();
  return absl::OkStatus();
}

void Engine::Enqueue(Command command) {
  {
    const std::lock_guard lock(mutex_);
    commands_.push_back(std::move(command));
  }
  wake_.notify_one();
}

std::size_t Engine::waiting() {
  const std::lock_guard lock(mutex_);
  return commands_.size() + asked_.size();
}

Command Engine::Next() {
  const std::lock_guard lock(mutex_);
  // In turn, so that neither keeps the other waiting for long.
  was_asked_ = !asked_.empty() && (!was_asked_ || commands_.empty());
  std::deque<Command>& queue = was_asked_ ? asked_ : commands_;
  if (queue.empty()) return nullptr;
  Command next = std::move(queue.front());
  queue.pop_front();
  return next;
}

void Engine::Run() {
  auto next_tick = std::chrono::steady_clock::now();
  while (true) {
    {
      std::unique_lock lock(mutex_);
      wake_.wait_until(lock, next_tick, [this] { return stopping_ || !commands_.empty() || !asked_.empty(); });
      if (stopping_ && commands_.empty() && asked_.empty()) return;
    }
    Turn turn(state_, MonotonicNow());
    const auto turn_ends = std::chrono::steady_clock::now() + kTurnTime;
    bool drained = false;
    while (std::chrono::steady_clock::now() < turn_ends) {
      const Command command = Next();
      drained = !command;
      if (drained) break;
      command(turn);
    }
    // After the commands: a sign of life that waits in the queue must be seen before its lease is judged.
    if (std::chrono::steady_clock::now() >= next_tick) {
      if (drained) turn.Apply(core::Tick{});
      next_tick = std::chrono::steady_clock::now() + kTick;
    }
    std::set<std::string> changed = std::exchange(changed_late_, {});
    changed.merge(std::exchange(turn.changed_jobs_, {}));
    adapters_.changed(turn, changed);
    changed_late_ = std::exchange(turn.changed_jobs_, {});
    if (!Finish(turn).ok()) return;
  }
}

absl::Status Engine::Finish(Turn& turn) {
  const absl::Status durable = Commit(turn);
  for (const auto& answer : turn.answers_) answer(durable);
  RETURN_IF_ERROR(durable);
  for (const auto& action : turn.after_) action();
  for (core::Message& message : turn.messages_) adapters_.send(std::move(message));
  if (!turn.look_ups_.empty()) adapters_.look_up(std::move(turn.look_ups_));
  return absl::OkStatus();
}

void Engine::NoteStalled(Turn& turn, const absl::Status& status) {
  {
    const std::lock_guard lock(mutex_);
    if (!stalled_.ok()) return;
    stalled_ = absl::Status(status.code(), fmt::format("the scheduler cannot write its state and waits: {}", std::string(status.message())));
  }
  if (adapters_.stalled) adapters_.stalled(stalled_);
  for (const auto& answer : std::exchange(turn.answers_, {})) answer(stalled_);
}

absl::Status Engine::Commit(Turn& turn) {
  if (turn.records_.empty()) return absl::OkStatus();
  auto pause = kCommitPauseFirst;
  int last_attempts = 0;
  for (int attempt = 1;; ++attempt) {
    const absl::Time begin = MonotonicNow();
    const absl::Status status = store_.Append(turn.records_);
    if (status.ok()) {
      if (adapters_.committed) adapters_.committed(turn.records_, MonotonicNow() - begin);
      const std::lock_guard lock(mutex_);
      if (!stalled_.ok()) spdlog::info("commits go on: attempt={}", attempt);
      stalled_ = absl::OkStatus();
      return status;
    }
    if (attempt % kAttemptsALogLine == 1)
      spdlog::error("commit failed: attempt={} records={} error=\"{}\"", attempt, turn.records_.size(), std::string(status.message()));
    if (absl::IsFailedPrecondition(status) || absl::IsDataLoss(status)) {
      lost_(status);
      const std::lock_guard lock(mutex_);
      stopping_ = true;
      return status;
    }
    // A connection that broke while it was idle shows at the first attempt; a full disk does not go away so fast.
    if (attempt > 1 || absl::IsResourceExhausted(status)) NoteStalled(turn, status);
    std::unique_lock lock(mutex_);
    wake_.wait_for(lock, pause, [this] { return stopping_; });
    if (stopping_ && ++last_attempts == kLastAttempts) return status;
    pause = std::min(2 * pause, kCommitPauseLast);
  }
}

}  // namespace vorocast::server
