// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "absl/time/time.h"
#include "scheduler/core/record.h"
#include "services/base/digest.h"
#include "services/base/status.h"

/// What a scheduler remembers over restarts.
namespace vorocast::store {

struct SequenceOpened {
  std::string id;
  std::string session;
  std::string name;
  double frames_per_second = 25;
  double metres_per_unit = 1;
  std::string up;
};
struct FrameAdded {
  std::string sequence;
  std::int32_t number = 0;
  base::Digest blob;
  std::string extension;
  std::int64_t size = 0;
};
struct SequenceClosed {
  std::string sequence;
};
struct JobAdded {
  std::string id;
  std::string sequence;
  std::string user;
  std::int32_t priority = 0;
  std::string spec_json;  // plan::JobSpec
  core::JobTerms terms{};
  double submitted = 0;  // seconds since 1970; 0: recorded by a version that did not note it
};

/// A job that has come to its end, as it is shown from then on without being planned again. core::JobRetried forgets it.
struct JobEnded {
  std::string job;
  std::string summary;  // v1::Job without the frames' own outputs
  std::string whole;    // v1::Job with all of them
  double ended = 0;     // seconds since 1970
};

/// Drops attempts of ended jobs that ended before `before`, at most so many at once: a long backlog goes little by little.
struct AttemptsForgotten {
  absl::Time before;
  std::int64_t count_max = 0;
};

using Record = std::variant<SequenceOpened, FrameAdded, SequenceClosed, JobAdded, JobEnded, AttemptsForgotten, core::Record>;

struct StoredSequence {
  SequenceOpened opened;
  bool closed = false;
  std::int64_t frame_count = 0;
  /// By number. Left out for a closed sequence whose jobs have all ended: LoadFrames brings them.
  std::optional<std::vector<FrameAdded>> frames;
};
struct StoredJob {
  JobAdded added;  // its limits as they are now
  bool cancelled = false;
  bool paused = false;
  bool ended = false;
  double ended_at = 0;                     // seconds since 1970; 0: not yet, or not noted
  std::vector<core::TaskFailed> failures;  // by task name; none for an ended job
};
/// What a scheduler needs to go on: everything but results and ended jobs, which are looked up when somebody asks.
struct Snapshot {
  std::vector<StoredSequence> sequences;  // in the order they were opened
  std::vector<StoredJob> jobs;            // in the order they were added
  std::vector<core::RunSaved> runs;       // by key
  std::int64_t attempt_next = 1;
};

enum class JobText { kSummary, kWhole };

/// Which attempts of a job are asked for.
struct AttemptQuery {
  std::string job;
  std::string task;   // a task's name; empty: all
  bool logs = false;  // with what they printed
  /// Only those after this one in the order that they ended; for the next portion, the last of the one before.
  std::optional<core::AttemptEnded> after;
  std::int32_t count_max = 1000;
};

/// One scheduler at a time writes. It leads under a term, a number larger than that of every leader before it, and every batch is written only
/// while that term is the newest: a leader that was stopped for a while, and replaced meanwhile, cannot overwrite what its successor did.
class Store {
 public:
  virtual ~Store() = default;

  /// Becomes the one that writes, and brings the schema up to date. Returns the term. To be called before everything else.
  /// Errors: FAILED_PRECONDITION names who leads now, or says that a newer version wrote this store; DATA_LOSS for a damaged one;
  /// UNAVAILABLE when it cannot be reached, RESOURCE_EXHAUSTED when its disk is full.
  virtual absl::StatusOr<std::int64_t> Lead(const std::string& address) = 0;
  /// Under which it leads; 0 before it has led.
  virtual std::int64_t term() const = 0;
  /// Where the present leader can be reached, as it said itself; empty if nobody knows.
  virtual std::string LeaderAddress() = 0;
  /// A leader's sign of life, about once a second, from one thread. FAILED_PRECONDITION: another leads now. UNAVAILABLE: not known.
  virtual absl::Status KeepLeading() = 0;

  virtual absl::StatusOr<Snapshot> Load() = 0;
  /// All of the records or none, in this order, durable on return. Writing a record twice is harmless, so a batch whose outcome is
  /// not known may be written again. FAILED_PRECONDITION: another leads now, and nothing was written.
  virtual absl::Status Append(const std::vector<Record>& records) = 0;

  // Safe to call from other threads.

  virtual absl::StatusOr<std::optional<core::Result>> FindResult(const base::Digest& key) = 0;
  /// Of an ended job; NOT_FOUND for another.
  virtual absl::StatusOr<std::string> FindJobText(const std::string& job, JobText which) = 0;
  /// By number.
  virtual absl::StatusOr<std::vector<FrameAdded>> LoadFrames(const std::string& sequence) = 0;
  /// In the order that they ended, to the microsecond.
  virtual absl::StatusOr<std::vector<core::AttemptEnded>> FindAttempts(const AttemptQuery& query) = 0;
};

}  // namespace vorocast::store
