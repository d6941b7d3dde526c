// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include "services/lease/executor.h"

namespace vorocast::agent {

/// The cells of a stretch's frames -> stretch.h5.
class StretchExecutor : public lease::Executor {
 public:
  tasks::Kind kind() const override { return tasks::Kind::kStretch; }
  absl::Status Execute(const tasks::TaskSpec& spec, const storage::ArtifactStore& store, const std::filesystem::path& output,
                       const base::Progress& progress) override;
};

}  // namespace vorocast::agent
