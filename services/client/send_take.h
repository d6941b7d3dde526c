// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <chrono>
#include <filesystem>
#include <string>

#include "proto/jobs.pb.h"
#include "services/base/status.h"
#include "services/capture/capture.h"
#include "services/client/scheduler_client.h"

namespace vorocast::client {

/// A file of this name in a capture's folder says that no frame will follow.
inline constexpr const char* kTakeIsOver = "capture.done";

struct FollowOptions {
  bool follow = false;
  std::chrono::seconds idle{60};            // the take is over when so long nothing was written; 0: only capture.done ends it
  std::chrono::milliseconds settle{1000};   // a file is whole when so long nothing was written to it
  std::chrono::milliseconds interval{500};  // between looks into the folder
};

/// Sends a capture to a scheduler under a session and asks for a job on it, with progress on the terminal. With `follow` the frames go as the
/// capture writes them and the job is asked for with the first. A scheduler that is away, or whose disk is full, is waited for; what it has already
/// is not sent again. Ends with the job as it was when the take was closed; CANCELLED when interrupted, after which the same call goes on.
absl::StatusOr<v1::Job> SendTake(SchedulerClient& client, const std::filesystem::path& folder, const capture::CaptureOptions& options,
                                 const std::string& session, v1::SubmitJobRequest request, const FollowOptions& follow);

}  // namespace vorocast::client
