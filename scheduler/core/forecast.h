// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <vector>

#include "scheduler/core/job_view.h"

namespace vorocast::core {

/// How long the job will take from the last tick on, as things are: on the slots that it gets beside other jobs now, with what each kind of task
/// has taken so far, stage after stage where one reads another. Negative while nothing has been measured, not all tasks are known, a kind with
/// work left has no worker, or the job is paused.
double SecondsLeft(const State& state, const Job& job, const std::vector<StageView>& stages);

}  // namespace vorocast::core
