// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <variant>
#include <vector>

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
};

using Record = std::variant<SequenceOpened, FrameAdded, SequenceClosed, JobAdded, core::Record>;

struct StoredSequence {
  SequenceOpened opened;
  bool closed = false;
  std::vector<FrameAdded> frames;  // by number
};
struct StoredJob {
  JobAdded added;
  bool cancelled = false;
  std::vector<core::TaskFailed> failures;  // by task name
};
/// Everything but the results, which are looked up by key.
struct Snapshot {
  std::vector<StoredSequence> sequences;  // in the order they were opened
  std::vector<StoredJob> jobs;            // in the order they were added
  std::vector<core::RunSaved> runs;       // by key
  std::int64_t attempt_next = 1;
};

class Store {
 public:
  virtual ~Store() = default;
  virtual absl::StatusOr<Snapshot> Load() = 0;
  /// All of the records or none, in this order, durable on return. Writing a record twice is harmless, so a batch whose outcome is
  /// not known may be written again.
  virtual absl::Status Append(const std::vector<Record>& records) = 0;
  /// Safe to call from other threads.
  virtual absl::StatusOr<std::optional<core::Result>> FindResult(const base::Digest& key) = 0;
};

}  // namespace vorocast::store
