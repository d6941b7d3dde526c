// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <string>

#include "proto/jobs.pb.h"
#include "scheduler/core/state.h"

namespace vorocast::server {

/// Who is connected, what they do, and who is set aside; not where they come from. Looks at every worker.
void FillFleet(const core::State& state, v1::Fleet& fleet);

/// " It will be late by …" for a job whose forecast end is after its deadline, " Its deadline passed … ago" once it is over; empty without one.
/// `wall`: seconds since 1970.
std::string ExplainLateness(const core::State& state, const core::Job& job, double wall);

}  // namespace vorocast::server
