// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <string>
#include <vector>

#include "scheduler/core/state.h"

/// What users see of the state. Reading it costs as much as what it shows.
namespace vorocast::core {

struct StageView {
  tasks::Kind kind = tasks::Kind::kTessellate;
  std::int32_t total = 0;
  std::int32_t done = 0;
  std::int32_t reused = 0;
  std::int32_t running = 0;
  std::int32_t failed = 0;
  std::int32_t cancelled = 0;
  double seconds_mean = 0;
  double fraction = 0;
};
struct FailureView {
  std::string task_id;  // empty: of the job as a whole
  std::string label;
  std::string cause;
};
struct OutputView {
  std::string name;
  base::Digest key;
  Result result;
  std::string extension;
};
struct JobView {
  Phase phase = Phase::kBlocked;  // kRunning while any task may still run
  std::vector<StageView> stages;  // in the order of the graph; only kinds that the job has
  std::vector<FailureView> failures;
  double seconds_left = -1;  // negative: not known yet
};

inline constexpr std::size_t kFailuresShown = 100;

Phase PhaseOf(const Job& job);
JobView View(const State& state, const Job& job);
/// Every output that exists; without the frames' own ones unless asked for, as a take has thousands.
std::vector<OutputView> Outputs(const State& state, const Job& job, bool with_frames);
/// NOT_FOUND says what becomes of it, or which outputs there are.
absl::StatusOr<OutputView> FindOutput(const State& state, const Job& job, const std::string& name);

/// Stays the same over restarts: "j12/frame 412: tessellate".
std::string TaskId(const Job& job, const Task& task);
/// Why the job stands where it stands, in one sentence.
std::string Explain(const State& state, const Job& job);
/// The same for one of its tasks, by id or name. NOT_FOUND for another name.
absl::StatusOr<std::string> Explain(const State& state, const Job& job, const std::string& task);

}  // namespace vorocast::core
