// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <cstddef>
#include <deque>
#include <set>
#include <string>

#include "proto/jobs.pb.h"
#include "scheduler/server/catalogue.h"
#include "scheduler/server/engine.h"

namespace vorocast::server {

/// Puts on record how a job looked when it had ended, and relieves the core of all but the last few ended jobs: memory and the time of a restart
/// grow with the work that is left, not with what has ever been done. Touched only inside turns.
class Archive {
 public:
  explicit Archive(Catalogue& catalogue) : catalogue_(catalogue) {}

  /// Called every turn, before whoever shows jobs: notes when they ended.
  void NoteEnds(const Turn& turn, const std::set<std::string>& jobs);
  /// Called every turn, after whoever shows jobs.
  void Changed(Turn& turn, const std::set<std::string>& jobs);

 private:
  struct Kept {
    std::string job;
    std::size_t tasks = 0;
  };
  void ForgetOld(Turn& turn);

  Catalogue& catalogue_;
  std::deque<Kept> kept_;  // ended jobs that the core still knows, oldest first
  std::size_t kept_tasks_ = 0;
};

/// One of an ended job's outputs, by name. NOT_FOUND if it has none of that name.
absl::StatusOr<v1::Output> FindEndedOutput(const Catalogue& catalogue, const std::string& job, const std::string& name);
/// Why the job, or one of its tasks (by label), ended as it did, as far as the record says. From any thread: it reads the store.
absl::StatusOr<std::string> ExplainEnded(const Catalogue& catalogue, const std::string& job, const std::string& task);

}  // namespace vorocast::server
