// SPDX-License-Identifier: AGPL-3.0-or-later
// A leader that was stopped for a while, and replaced: it wakes, still believes that it leads, and hears from the workers whose streams stand.
#include <utility>

#include <fmt/format.h>

#include "tests/scenario/simulated_farm.h"

namespace vorocast::scenario {

absl::Status SimulatedFarm::Replace() {
  EndReplaced();  // one at a time
  const absl::Time wakes_at = now_ + absl::Milliseconds(static_cast<std::int64_t>(random_.Below(15'000)));
  replaced_.emplace(Replaced{.term = term_,
                             .state = std::exchange(state_, {}),
                             .answers = std::exchange(answers_, {}),
                             .wakes_at = wakes_at,
                             .learns_at = wakes_at + absl::Milliseconds(static_cast<std::int64_t>(random_.Below(2'000)))});
  for (const auto& [connection, stream] : to_worker_) to_replaced_.insert(connection);
  for (const auto& [connection, stream] : to_scheduler_) to_replaced_.insert(connection);
  for (const auto& [connection, stream] : std::map(to_worker_)) {
    if (Chance(0.5)) Break(connection);
  }
  return Lead();
}

absl::Status SimulatedFarm::HappenToReplaced(core::Event event) {
  if (!replaced_) return absl::OkStatus();
  ++steps_;
  core::Effects effects = core::Step(replaced_->state, std::move(event), now_);
  RETURN_IF_ERROR(Check(replaced_->state));
  if (!effects.records.empty()) {
    const std::string before = memory_.Text();
    if (memory_.Append(replaced_->term, effects.records).ok() || memory_.Text() != before) {
      return Wrong(fmt::format("the leader of term {} wrote under term {}", replaced_->term, memory_.term));
    }
    ++refused_;
    EndReplaced();
    return absl::OkStatus();
  }
  // What needs no record goes out all the same.
  Send(std::move(effects.messages));
  for (const core::LookUp& look_up : effects.look_ups) replaced_->answers.push_back({now_ + Delay(), Answer(look_up)});
  return absl::OkStatus();
}

absl::Status SimulatedFarm::MoveReplaced() {
  if (!replaced_ || (now_ < replaced_->wakes_at && !calm_)) return absl::OkStatus();
  if (calm_ || now_ >= replaced_->learns_at) {
    EndReplaced();
    return absl::OkStatus();
  }
  while (replaced_ && !replaced_->answers.empty() && replaced_->answers.front().at <= now_) {
    core::Event event = std::move(replaced_->answers.front().event);
    replaced_->answers.pop_front();
    RETURN_IF_ERROR(HappenToReplaced(std::move(event)));
  }
  return HappenToReplaced(core::Tick{});
}

void SimulatedFarm::EndReplaced() {
  if (!replaced_) return;
  replaced_.reset();
  for (const auto& [connection, stream] : std::map(to_worker_)) {
    if (to_replaced_.contains(connection)) Break(connection);
  }
}

}  // namespace vorocast::scenario
