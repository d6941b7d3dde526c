// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include "services/lease/executor.h"

namespace vorocast::agent {

/// One instant of a take -> OpenEXR. Inputs: "tracked" tracked.h5, and "simulated" the simulated.h5 that was run on it, where there is an effect.
class RenderExecutor : public lease::Executor {
 public:
  tasks::Kind kind() const override { return tasks::Kind::kRender; }
  absl::Status Execute(const tasks::TaskSpec& spec, const storage::ArtifactStore& store, const std::filesystem::path& output,
                       const base::Progress& progress) override;
};

}  // namespace vorocast::agent
