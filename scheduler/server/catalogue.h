// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <cstdint>
#include <deque>
#include <map>
#include <optional>
#include <set>
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
  bool paused = false;
  double ended_at = 0;  // seconds since 1970; 0: not yet, or not noted
  std::string onto;     // its second take's sequence, if it has one; known while the job goes on
};

/// The sequences and jobs that there are, and what follows for the core from each change of them. Touched only inside turns.
class Catalogue {
 public:
  /// `store` must outlive the catalogue.
  explicit Catalogue(store::Store& store) : store_(store) {}

  /// Takes up what the store remembers; first turn of an engine. The jobs that go on are planned afterwards, by PlanSome.
  absl::Status Restore(Turn& turn, store::Snapshot snapshot);
  /// Tells the core of some of the tasks that follow from what has changed, most urgent jobs first; whether there are more. Called every turn: a
  /// long take or a long restored queue neither holds up answers nor keeps the scheduler from working on what it knows already.
  bool PlanSome(Turn& turn);

  /// The sequence of that session and name, opened if need be. ALREADY_EXISTS if it has other properties than asked for.
  absl::StatusOr<const CatalogueSequence*> Open(Turn& turn, store::SequenceOpened asked);
  absl::StatusOr<const CatalogueSequence*> Add(Turn& turn, const std::string& sequence, std::vector<store::FrameAdded> frames);
  absl::StatusOr<const CatalogueSequence*> Close(Turn& turn, const std::string& sequence);
  /// A second take of the spec is known to be there. Returns the job's id.
  absl::StatusOr<std::string> Submit(Turn& turn, const std::string& sequence, const std::string& user, std::int32_t priority, plan::JobSpec spec,
                                     const core::JobTerms& terms = {});
  /// Under other limits, if `terms` has others than the job.
  absl::Status Retry(Turn& turn, const std::string& job, const core::JobTerms& terms);
  /// FAILED_PRECONDITION for a job that has ended.
  absl::Status Pause(Turn& turn, const std::string& job, bool paused);
  /// Notes when the job ended, in seconds since 1970, unless that is known.
  void NoteEnd(const std::string& job, double at);
  /// Notes that the job has ended and is on record.
  void End(const std::string& job);

  /// NOT_FOUND names what was asked for.
  absl::StatusOr<const CatalogueSequence*> FindSequence(const std::string& id) const;
  absl::StatusOr<const CatalogueJob*> FindJob(const std::string& id) const;
  /// Ids, in the order they were submitted.
  const std::vector<std::string>& job_order() const { return job_order_; }

  /// A captured frame of a sequence. NOT_FOUND names it.
  absl::StatusOr<store::FrameAdded> FindFrame(const CatalogueSequence& sequence, std::int32_t number) const;

  /// Some jobs' tasks are not all known to the core yet.
  bool is_planning() const { return !plannings_.empty(); }
  /// Adds the frames of every sequence that is open or has a job that goes on.
  void AddFramesInUse(std::set<base::Digest>& blobs) const;

  // Of what is on record, from any thread.

  absl::StatusOr<std::vector<core::AttemptEnded>> FindAttempts(const store::AttemptQuery& query) const { return store_.FindAttempts(query); }
  /// v1::Job, in bytes, of an ended job.
  absl::StatusOr<std::string> EndedText(const std::string& job, store::JobText which) const { return store_.FindJobText(job, which); }

 private:
  /// As the core is told of it.
  core::JobSubmitted Submission(const CatalogueJob& job) const;
  /// A job's tasks on their way to the core.
  struct Planning {
    std::string job;
    std::int32_t priority = 0;
    std::optional<std::vector<store::FrameAdded>> frames;  // which have been added to one sequence; nothing: all of the job's sequences
    std::optional<core::TasksAdded> added;                 // once planned: what the core has not been told yet, in `tasks` from `next`
    std::size_t next = 0;
  };
  void Plan(const CatalogueJob& job, std::optional<std::vector<store::FrameAdded>> frames = std::nullopt);
  absl::Status Expand(Planning& planning);
  absl::Status NeedFrames(CatalogueSequence& sequence) const;
  /// Loads them if need be.
  absl::StatusOr<plan::KnownTake> AllKnown(CatalogueSequence& sequence) const;
  /// Has the job told of whatever is added to its sequences.
  void Follow(const std::string& job);
  /// Forgets the frames where nobody needs them any more.
  void Tidy(CatalogueSequence& sequence) const;

  store::Store& store_;
  std::map<std::string, CatalogueSequence> sequences_;
  std::map<std::pair<std::string, std::string>, std::string> sequence_by_name_;
  std::map<std::string, CatalogueJob> jobs_;
  std::vector<std::string> job_order_;
  std::deque<Planning> plannings_;  // most urgent first, and one job's in the order that they came
};

}  // namespace vorocast::server
