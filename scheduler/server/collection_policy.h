// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <cstdint>
#include <set>
#include <vector>

#include "absl/time/time.h"
#include "services/base/digest.h"
#include "services/storage/collection.h"

namespace vorocast::server {

/// What is kept, and what of the rest goes.
struct CollectionPolicy {
  absl::Duration keep = absl::InfiniteDuration();  // what nobody has used for longer goes
  std::int64_t disk_limit = 0;                     // bytes; with more than this, what was used longest ago goes; 0: no limit
  absl::Duration keep_at_least = absl::Hours(24);  // what was used since is never touched, not even for the limit
  bool asked_for() const { return keep < absl::InfiniteDuration() || disk_limit > 0; }
};

/// Keys of results and digests of blobs that an unfinished job may still read.
struct InUse {
  std::set<base::Digest> results;
  std::set<base::Digest> blobs;
};

struct Collected {
  enum class Why : std::uint8_t { kOld, kLimit };
  storage::StoredFile file;
  Why why = Why::kOld;
};

struct CollectionPlan {
  std::vector<Collected> remove;  // used longest ago first; equal times by digest
  std::int64_t bytes = 0;         // of those
  std::int64_t bytes_before = 0;  // of all files
  std::int64_t bytes_in_use = 0;
};

/// Values in, values out.
CollectionPlan PlanCollection(std::vector<storage::StoredFile> files, const InUse& in_use, const CollectionPolicy& policy, absl::Time now);

}  // namespace vorocast::server
