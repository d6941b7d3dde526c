// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include "proto/jobs.pb.h"
#include "scheduler/plan/plan.h"
#include "scheduler/store/store.h"
#include "services/base/status.h"

namespace vorocast::server {

/// What a client asks for, checked and with defaults filled in, but for what the sequence says (SetCapture).
/// INVALID_ARGUMENT names the field and what it may hold.
absl::StatusOr<plan::JobSpec> SpecOf(const v1::SubmitJobRequest& request);

/// The capture's units, axis and rate.
void SetCapture(const store::SequenceOpened& sequence, plan::JobSpec& spec);

}  // namespace vorocast::server
