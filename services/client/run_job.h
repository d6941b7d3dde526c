// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <filesystem>
#include <string>

#include "services/base/status.h"
#include "services/capture/capture.h"
#include "services/client/scheduler_client.h"

namespace vorocast::client {

struct RunOptions {
  std::filesystem::path out;
  std::filesystem::path state;
  std::int32_t workers = 0;
};

/// The whole job on this machine (`onto`: and its second take, or null): service up, frames in, progress shown, results fetched to `out`, service
/// down. Goes on through a scheduler's death; stopped by Ctrl-C, and taken up again by the same call. Prints where the results are. Returns the exit
/// code.
int RunJob(const capture::Capture& capture, const capture::Capture* onto, v1::SubmitJobRequest request, const RunOptions& options);

/// Fetches all outputs of a job that exist into a folder, with progress.
absl::Status FetchOutputs(SchedulerClient& client, const v1::Job& job, const std::filesystem::path& folder);

/// Reads the first readable frame of first, middle and last, so that a wrong unit or axis is told before anything is computed.
absl::Status CheckCapture(const capture::Capture& capture);

/// Prints "vorocast: error: …" and gives the exit code that fits: 2 for what the user can correct, 1 for the rest.
int PrintError(const absl::Status& status);

}  // namespace vorocast::client
