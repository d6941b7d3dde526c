// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <atomic>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <thread>

#include "proto/dispatch.pb.h"
#include "services/lease/child_process.h"
#include "services/lease/input_check.h"
#include "services/lease/remote_artifacts.h"
#include "services/storage/artifact_store.h"
#include "services/tasks/task.h"

namespace vorocast::lease {

/// One attempt at one task under way: its child process, watched by a thread of its own. The result is published before the end is told.
class Attempt {
 public:
  /// Starts at once. `inputs` must outlive the attempt, as must `remote`, which brings inputs into `store` and takes results from it; null where
  /// `store` is the shared folder. `on_end` is called once, from the attempt's thread. Destroying an attempt stops it and waits.
  Attempt(v1::Lease lease, std::filesystem::path program, storage::ArtifactStore store, InputCheck& inputs, std::function<void(v1::Finished)> on_end,
          RemoteArtifacts* remote = nullptr);
  ~Attempt();

  /// Kills the child; the attempt then ends as given back (DRAINED).
  void Stop() { stop_.Stop(); }
  double fraction() const { return fraction_.load(std::memory_order_relaxed); }
  const v1::Lease& lease() const { return lease_; }

 private:
  v1::Finished Run();
  v1::Finished RunSpec(const tasks::TaskSpec& spec);
  /// What follows from how the child ended and what it said last.
  v1::Finished Judge(const tasks::TaskSpec& spec, const std::filesystem::path& output, const ChildEnd& child,
                     const std::optional<absl::Status>& outcome) const;
  v1::Finished Publish(const tasks::TaskSpec& spec, const std::filesystem::path& output, const ChildEnd& end) const;
  v1::Finished FailTransfer(const absl::Status& status, double seconds) const;
  v1::Finished Fail(v1::Failed::Cause cause, std::string_view message, double seconds) const;

  const v1::Lease lease_;
  const std::filesystem::path program_;
  const storage::ArtifactStore store_;
  InputCheck& inputs_;
  RemoteArtifacts* const remote_;
  StopFlag stop_;
  std::atomic<double> fraction_ = 0;
  std::thread thread_;  // last: it uses the others
};

/// What a status of an executor says about whose fault it was (executor.h).
v1::Failed::Cause CauseOf(const absl::Status& status);

/// The end of an attempt that did not succeed.
v1::Finished FailedAttempt(const v1::AttemptId& id, v1::Failed::Cause cause, std::string_view message, double seconds);

}  // namespace vorocast::lease
