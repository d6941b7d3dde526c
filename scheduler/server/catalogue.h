// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "scheduler/plan/plan.h"
#include "scheduler/server/engine.h"
#include "scheduler/store/store.h"

namespace vorocast::server {

struct CatalogueSequence {
  store::SequenceOpened opened;
  bool closed = false;
  std::map<std::int32_t, store::FrameAdded> frames;  // by number
  std::vector<std::string> jobs;                     // in the order they were submitted
};
struct CatalogueJob {
  store::JobAdded added;
  plan::JobSpec spec;
};

/// The sequences and jobs that there are, and what follows for the core from each change of them. Touched only inside turns.
class Catalogue {
 public:
  /// Rebuilds everything from what the store remembers; first turn of an engine.
  absl::Status Restore(Turn& turn, store::Snapshot snapshot);

  /// The sequence of that session and name, opened if need be. ALREADY_EXISTS if it has other properties than asked for.
  absl::StatusOr<const CatalogueSequence*> Open(Turn& turn, store::SequenceOpened asked);
  absl::StatusOr<const CatalogueSequence*> Add(Turn& turn, const std::string& sequence, std::vector<store::FrameAdded> frames);
  absl::StatusOr<const CatalogueSequence*> Close(Turn& turn, const std::string& sequence);
  /// Returns the job's id.
  absl::StatusOr<std::string> Submit(Turn& turn, const std::string& sequence, const std::string& user, std::int32_t priority, plan::JobSpec spec);

  /// NOT_FOUND names what was asked for.
  absl::StatusOr<const CatalogueSequence*> FindSequence(const std::string& id) const;
  absl::StatusOr<const CatalogueJob*> FindJob(const std::string& id) const;
  /// Ids, in the order they were submitted.
  const std::vector<std::string>& job_order() const { return job_order_; }

 private:
  void Plan(Turn& turn, const CatalogueJob& job, const CatalogueSequence& sequence, const std::vector<store::FrameAdded>& frames) const;
  void PlanWhole(Turn& turn, const CatalogueJob& job, const CatalogueSequence& sequence) const;

  std::map<std::string, CatalogueSequence> sequences_;
  std::map<std::pair<std::string, std::string>, std::string> sequence_by_name_;
  std::map<std::string, CatalogueJob> jobs_;
  std::vector<std::string> job_order_;
};

}  // namespace vorocast::server
