// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "scheduler/core/record.h"
#include "scheduler/plan/plan.h"
#include "services/base/digest.h"
#include "services/base/status.h"

namespace vorocast::scenario {

/// What a store remembers, as plain maps, under the rules of store::Store: who leads writes, all others are refused. Survives the schedulers.
struct SimulatedStore {
  struct SubmittedJob {
    std::string id;
    std::string user;
    std::int32_t priority = 0;
    plan::JobSpec spec;
    core::JobTerms terms{};
    bool cancelled = false;
    bool paused = false;
    std::map<std::string, core::TaskFailed> failures;
  };
  std::int64_t term = 0;
  std::vector<SubmittedJob> jobs;
  std::map<base::Digest, core::Result> results;
  std::map<base::Digest, core::RunSaved> runs;
  std::int64_t attempt_next = 1;

  /// The new leader's term.
  std::int64_t Lead() { return ++term; }
  /// FAILED_PRECONDITION: another leads, and nothing is written.
  absl::Status Append(std::int64_t under_term, const std::vector<core::Record>& records);
  /// All of it but the specs, to compare.
  std::string Text() const;
};

}  // namespace vorocast::scenario
