// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <cstdint>
#include <deque>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "scheduler/plan/plan.h"
#include "scheduler/server/engine.h"
#include "scheduler/store/store.h"

namespace vorocast::server {

struct CatalogueSequence {
  store::SequenceOpened opened;
  bool closed = false;
  std::int64_t frame_count = 0;
  /// By number. Nothing while nobody needs them: closed, and all its jobs ended.
  std::optional<std::map<std::int32_t, store::FrameAdded>> frames;
  std::vector<std::string> jobs;  // in the order they were submitted
};
struct CatalogueJob {
  store::JobAdded added;
  bool ended = false;  // on record; the core may have forgotten it
};

/// The sequences and jobs that there are, and what follows for the core from each change of them. Touched only inside turns.
class Catalogue {
 public:
  /// `store` must outlive the catalogue.
  explicit Catalogue(store::Store& store) : store_(store) {}

  /// Takes up what the store remembers; first turn of an engine. The jobs that go on are planned afterwards, by PlanNext.
  absl::Status Restore(Turn& turn, store::Snapshot snapshot);
  /// Plans the most urgent of the restored jobs that have not been planned yet; whether there are more. In turns of their own, so that
  /// the scheduler is back at work while a long queue is still being planned.
  bool PlanNext(Turn& turn);

  /// The sequence of that session and name, opened if need be. ALREADY_EXISTS if it has other properties than asked for.
  absl::StatusOr<const CatalogueSequence*> Open(Turn& turn, store::SequenceOpened asked);
  absl::StatusOr<const CatalogueSequence*> Add(Turn& turn, const std::string& sequence, std::vector<store::FrameAdded> frames);
  absl::StatusOr<const CatalogueSequence*> Close(Turn& turn, const std::string& sequence);
  /// Returns the job's id.
  absl::StatusOr<std::string> Submit(Turn& turn, const std::string& sequence, const std::string& user, std::int32_t priority, plan::JobSpec spec);
  absl::Status Retry(Turn& turn, const std::string& job);
  /// Notes that the job has ended and is on record.
  void End(const std::string& job);

  /// NOT_FOUND names what was asked for.
  absl::StatusOr<const CatalogueSequence*> FindSequence(const std::string& id) const;
  absl::StatusOr<const CatalogueJob*> FindJob(const std::string& id) const;
  /// Ids, in the order they were submitted.
  const std::vector<std::string>& job_order() const { return job_order_; }

  /// v1::Job, in bytes, of an ended job.
  absl::StatusOr<std::string> EndedText(const std::string& job, store::JobText which) const { return store_.FindJobText(job, which); }

 private:
  void Plan(Turn& turn, const CatalogueJob& job, const CatalogueSequence& sequence, const std::vector<store::FrameAdded>& frames) const;
  absl::Status PlanWhole(Turn& turn, const CatalogueJob& job, CatalogueSequence& sequence) const;
  absl::Status NeedFrames(CatalogueSequence& sequence) const;

  store::Store& store_;
  std::map<std::string, CatalogueSequence> sequences_;
  std::map<std::pair<std::string, std::string>, std::string> sequence_by_name_;
  std::map<std::string, CatalogueJob> jobs_;
  std::vector<std::string> job_order_;
  std::deque<std::string> unplanned_;  // restored jobs, most urgent first
};

}  // namespace vorocast::server
