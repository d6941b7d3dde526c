// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "absl/time/time.h"
#include "scheduler/core/state.h"
#include "scheduler/plan/plan.h"
#include "services/base/status.h"

/// A farm without mishaps in simulated time: the scheduler's plan and core as they are, and workers of which only the time they take is made up.
namespace vorocast::scenario {

/// What a task of one kind takes on one core.
struct TaskTime {
  double start_s = 0;      // whatever it reads
  double per_input_s = 0;  // for each result it reads
  double spread = 0;       // standard deviation of the logarithm, from task to task
};

struct FarmTimes {
  std::array<TaskTime, core::kKinds> of{};           // by tasks::Kind
  absl::Duration look_up = absl::Milliseconds(1);    // does a result exist already?
  absl::Duration message = absl::Microseconds(500);  // from the scheduler to a worker or back
  absl::Duration process = absl::Milliseconds(20);   // a child process's start and end, publishing and its sync to disk
  absl::Duration heartbeat = absl::Seconds(2);
  std::uint64_t seed = 1;
};

struct FarmRun {
  double wall_s = 0;  // from the submission to the take's last task
  double busy_s = 0;  // of all workers
  std::int64_t tasks = 0;
  std::array<double, core::kKinds> ended_s{};  // when the last task of each kind ended
  std::array<double, core::kKinds> spent_s{};
  /// What the scheduler said on the way: when, and how long it would still take.
  std::vector<std::pair<double, double>> forecasts;
};

/// One closed take, tracked by so many workers of one slot. INTERNAL when it does not end as a job should.
absl::StatusOr<FarmRun> RunClockedFarm(const plan::JobSpec& job, std::int32_t frames, std::int32_t workers, const FarmTimes& times);

}  // namespace vorocast::scenario
