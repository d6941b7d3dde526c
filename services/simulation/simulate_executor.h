// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include "services/lease/executor.h"

namespace vorocast::simulation {

/// tracked.h5 and an effect -> simulated.h5. The input has the role "tracked"; an effect with a morph has a second one, a tracked.h5 too, with the
/// role "target". The options are tasks::SimulateOptions.
class SimulateExecutor : public lease::Executor {
 public:
  tasks::Kind kind() const override { return tasks::Kind::kSimulate; }
  absl::Status Execute(const tasks::TaskSpec& spec, const storage::ArtifactStore& store, const std::filesystem::path& output,
                       const base::Progress& progress) override;
};

/// The task of one effect on one tracked take, as the scheduler would plan it: so both give the result the same key.
tasks::TaskSpec SimulateTask(const base::Digest& tracked_key, const nlohmann::json& canonical_effect);

}  // namespace vorocast::simulation
