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

/// When and how far it may run. The same errors.
absl::StatusOr<core::JobTerms> TermsOf(const v1::SubmitJobRequest& request);
/// Of the limits of a retry: those that are 0 stay as they are in `terms`.
absl::Status SetLimits(const v1::RetryJobRequest& request, core::JobTerms& terms);

/// The capture's units, axis and rate.
void SetCapture(const store::SequenceOpened& sequence, plan::JobSpec& spec);
/// The second take, with its own units, axis and rate.
void SetOnto(const store::SequenceOpened& sequence, plan::JobSpec& spec);

}  // namespace vorocast::server
