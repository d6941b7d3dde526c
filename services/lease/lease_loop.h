// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "absl/time/time.h"
#include "services/base/status.h"
#include "services/lease/executor.h"
#include "services/rpc/security.h"

namespace vorocast::lease {

class LeaseMetrics;

/// What a scheduler takes.
inline constexpr std::int32_t kSlotsMax = 4096;
inline constexpr std::size_t kNameMax = 200;

struct LeaseLoopOptions {
  std::string scheduler;          // host:port, or unix:/path; several, separated by commas, of which one leads
  rpc::ClientSecurity security;   // how to connect to it
  std::int32_t slots = 1;         // tasks at once
  std::filesystem::path program;  // run as `program execute-task` for each task
  bool artifacts_remote = false;  // inputs and results go through the scheduler, by way of `cache`; otherwise through the shared folder
  std::filesystem::path cache;
  std::int64_t cache_limit = std::int64_t{20} << 30;  // bytes
  std::string name;                                   // empty: host, pid, start time
  absl::Duration heartbeat = absl::Seconds(2);
  absl::Duration leave_after = absl::InfiniteDuration();  // leaves by itself when the scheduler has been away so long
  absl::Duration drain_time = absl::Seconds(30);          // after SIGTERM, what still runs then is given back
  LeaseMetrics* metrics = nullptr;                        // told what happens; must outlive the loop
};

/// How it came to an end.
struct LeaseLoopSummary {
  bool told_to_stop = false;    // by a signal, rather than because the scheduler was away
  std::int32_t given_back = 0;  // tasks that had not ended
};

/// Takes leases until told to stop (SIGTERM or SIGINT drains), each task in a child process with its memory and time limits.
/// proto/dispatch.proto tells the protocol. Returns when drained.
absl::Status RunLeaseLoop(const LeaseLoopOptions& options, const std::vector<tasks::Kind>& kinds, LeaseLoopSummary* summary = nullptr);

/// The exit code of a worker that was told to stop with work left: whoever provides it may start it again elsewhere.
inline constexpr int kWorkLeft = 75;

/// What `program execute-task` does: reads one task from standard input, runs its executor, writes progress and the outcome to standard output.
/// Returns the process's exit code.
int ExecuteTaskMain(const std::vector<std::unique_ptr<Executor>>& executors);

}  // namespace vorocast::lease
