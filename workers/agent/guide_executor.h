// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include "services/lease/executor.h"

namespace vorocast::agent {

/// Template and every frame's cells, or all stretches and the cells of the frames they share -> guide.h5.
class GuideExecutor : public lease::Executor {
 public:
  tasks::Kind kind() const override { return tasks::Kind::kGuide; }
  absl::Status Execute(const tasks::TaskSpec& spec, const storage::ArtifactStore& store, const std::filesystem::path& output,
                       const base::Progress& progress) override;
};

}  // namespace vorocast::agent
