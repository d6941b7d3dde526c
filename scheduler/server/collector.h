// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <condition_variable>
#include <functional>
#include <memory>
#include <mutex>
#include <thread>

#include "absl/time/clock.h"
#include "absl/time/time.h"
#include "scheduler/server/catalogue.h"
#include "scheduler/server/collection_policy.h"
#include "scheduler/server/engine.h"
#include "scheduler/server/scheduler_metrics.h"
#include "services/storage/artifact_store.h"

namespace vorocast::server {

struct CollectorOptions {
  CollectionPolicy policy;
  bool dry_run = false;                                 // only says what would go
  absl::Duration every = absl::Hours(1);                // between rounds, and before the first
  absl::Duration keep_attempts = absl::Hours(24 * 30);  // of ended jobs, and what they printed
  std::function<absl::Time()> now = absl::Now;
};

/// Keeps the disk from filling up: removes captured frames and results that no unfinished job reads, by the policy and on its own thread, and
/// forgets old attempts. A result that is asked for again is made again; a frame is sent again.
///
/// Nothing that is wanted goes: what unfinished jobs read is asked of the engine after the files have been listed, and whoever finds a file
/// from then on notes its use, which makes the removal pass it over (storage/collection.h).
class Collector {
 public:
  /// All must outlive the collector; the engine has been started.
  Collector(Engine& engine, const Catalogue& catalogue, const storage::ArtifactStore& artifacts, SchedulerMetrics& metrics, CollectorOptions options);
  ~Collector();

  /// One round, now; what it removed, or would have. UNAVAILABLE while jobs are still being planned or the store cannot be written: who reads what
  /// is not known then.
  absl::StatusOr<CollectionPlan> Collect();

 private:
  void Loop();
  bool stopping();
  absl::StatusOr<InUse> AskInUse();
  /// Within a turn, for who waits.
  absl::Status InTurn(std::function<void(Turn&)> work);
  void Remove(CollectionPlan& plan);
  void ForgetAttempts();

  Engine& engine_;
  const Catalogue& catalogue_;
  const storage::ArtifactStore& artifacts_;
  SchedulerMetrics& metrics_;
  const CollectorOptions options_;
  std::mutex mutex_;
  std::condition_variable wake_;
  bool stopping_ = false;  // guarded by mutex_
  std::thread thread_;
};

}  // namespace vorocast::server
