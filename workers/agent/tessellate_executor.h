// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include "services/lease/executor.h"

namespace vorocast::agent {

/// One frame's points -> cells.h5.
class TessellateExecutor : public lease::Executor {
 public:
  tasks::Kind kind() const override { return tasks::Kind::kTessellate; }
  absl::Status Execute(const tasks::TaskSpec& spec, const storage::ArtifactStore& store, const std::filesystem::path& output,
                       const base::Progress& progress) override;
};

}  // namespace vorocast::agent
