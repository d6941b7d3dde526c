// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <filesystem>

#include "services/base/progress.h"
#include "services/base/status.h"
#include "services/storage/artifact_store.h"
#include "services/tasks/task.h"

namespace vorocast::lease {

/// Runs one kind of task. Runs inside the task's own child process: it may crash or be killed without harm to the worker.
class Executor {
 public:
  virtual ~Executor() = default;
  virtual tasks::Kind kind() const = 0;
  /// Reads spec.inputs from the store and writes the result to `output` (a temporary path that the caller publishes).
  /// The code of an error tells its cause: INVALID_ARGUMENT and DATA_LOSS the input, RESOURCE_EXHAUSTED memory, UNAVAILABLE the store.
  virtual absl::Status Execute(const tasks::TaskSpec& spec, const storage::ArtifactStore& store, const std::filesystem::path& output,
                               const base::Progress& progress) = 0;
};

}  // namespace vorocast::lease
