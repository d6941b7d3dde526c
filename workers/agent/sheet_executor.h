// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include "services/lease/executor.h"

namespace vorocast::agent {

/// Pictures of one stage of a take -> PNG. Inputs by stage: "points" the frames' blobs; "cells" cells.h5 files and perhaps the template; "tracked"
/// tracked.h5; "simulated" simulated.h5 and the tracked.h5 it was run on.
class SheetExecutor : public lease::Executor {
 public:
  tasks::Kind kind() const override { return tasks::Kind::kSheet; }
  absl::Status Execute(const tasks::TaskSpec& spec, const storage::ArtifactStore& store, const std::filesystem::path& output,
                       const base::Progress& progress) override;
};

}  // namespace vorocast::agent
