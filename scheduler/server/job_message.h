// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include "proto/jobs.pb.h"
#include "scheduler/core/state.h"
#include "scheduler/server/catalogue.h"

namespace vorocast::server {

enum class FrameOutputs { kLeftOut, kListed };

/// The job as users see it now, or as it was when it ended.
absl::StatusOr<v1::Job> JobMessage(const core::State& state, const Catalogue& catalogue, const CatalogueJob& job, FrameOutputs frames);

/// Nothing more will happen to a job in this state, unless somebody asks for a retry.
inline bool HasEnded(v1::State state) { return state == v1::DONE || state == v1::FAILED || state == v1::CANCELLED; }

}  // namespace vorocast::server
