// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <vector>

#include <prometheus/counter.h>
#include <prometheus/family.h>
#include <prometheus/gauge.h>
#include <prometheus/histogram.h>
#include <prometheus/registry.h>

#include "absl/time/time.h"
#include "scheduler/core/state.h"
#include "scheduler/store/store.h"

namespace vorocast::server {

/// What a scheduler counts about itself (docs/operations.md lists the names). Counters follow what has been committed; gauges are set anew about
/// once a second from counts that the core keeps, so a scrape costs nothing and never waits for the engine.
class SchedulerMetrics {
 public:
  SchedulerMetrics();

  // On the engine's thread.

  void Committed(const std::vector<store::Record>& records, absl::Duration took);
  void Stalled() { stalls_.Increment(); }
  /// Does something only if the last time was long enough ago. `waiting`: commands in the engine's queue.
  void Refresh(const core::State& state, std::size_t waiting, absl::Time now);

  // From any thread.

  void SetTerm(std::int64_t term) { term_.Set(static_cast<double>(term)); }
  void Uploaded(std::int64_t bytes) { upload_bytes_.Increment(static_cast<double>(bytes)); }
  void Collected(std::int64_t files, std::int64_t bytes);
  /// Of blobs and results, as the collector last saw them.
  void SetStored(std::int64_t bytes) { stored_bytes_.Set(static_cast<double>(bytes)); }

  const std::shared_ptr<prometheus::Registry>& registry() const { return registry_; }

 private:
  void Count(const core::AttemptEnded& ended);

  std::shared_ptr<prometheus::Registry> registry_ = std::make_shared<prometheus::Registry>();
  std::array<std::array<prometheus::Gauge*, core::kPhases>, core::kKinds> tasks_{};
  std::array<prometheus::Gauge*, core::kPhases> jobs_{};
  std::array<prometheus::Histogram*, core::kKinds> task_seconds_{};
  prometheus::Family<prometheus::Counter>& attempts_;
  prometheus::Gauge& workers_;
  prometheus::Gauge& slots_;
  prometheus::Gauge& busy_;
  prometheus::Gauge& waiting_;
  prometheus::Gauge& term_;
  prometheus::Gauge& stored_bytes_;
  prometheus::Histogram& commit_seconds_;
  prometheus::Counter& commit_records_;
  prometheus::Counter& stalls_;
  prometheus::Counter& upload_bytes_;
  prometheus::Counter& result_bytes_;
  prometheus::Counter& collected_files_;
  prometheus::Counter& collected_bytes_;
  absl::Time refreshed_ = absl::InfinitePast();
};

}  // namespace vorocast::server
