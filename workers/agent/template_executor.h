// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include "services/lease/executor.h"

namespace vorocast::agent {

/// One frame's points, with more iterations, and its patches -> template.h5. Chooses the frame where the options leave it open.
class TemplateExecutor : public lease::Executor {
 public:
  tasks::Kind kind() const override { return tasks::Kind::kTemplate; }
  absl::Status Execute(const tasks::TaskSpec& spec, const storage::ArtifactStore& store, const std::filesystem::path& output,
                       const base::Progress& progress) override;
};

}  // namespace vorocast::agent
