// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <string>

#include "proto/dispatch.pb.h"
#include "scheduler/core/effects.h"
#include "scheduler/core/event.h"
#include "services/base/status.h"

namespace vorocast::server {

/// What came from a worker, checked. INVALID_ARGUMENT says what is wrong with it.
absl::StatusOr<core::Event> EventOf(core::ConnectionId connection, const v1::WorkerMessage& message);

v1::SchedulerMessage MessageOf(const core::Message& message, const std::string& artifact_root);

}  // namespace vorocast::server
