// SPDX-License-Identifier: AGPL-3.0-or-later
#include "services/simulation/simulate_executor.h"

#include <fmt/format.h>

#include "services/simulation/simulate.h"
#include "services/storage/hdf5_artifacts.h"
#include "services/tasks/options.h"

namespace vorocast::simulation {

absl::Status SimulateExecutor::Execute(const tasks::TaskSpec& spec, const storage::ArtifactStore& store, const std::filesystem::path& output,
                                       const base::Progress& progress) {
  tasks::SimulateOptions options;
  RETURN_IF_ERROR(FromJson(spec.options, options));
  if (spec.inputs.size() != 1 || spec.inputs[0].role != "tracked" || !spec.inputs[0].digest) {
    return absl::InvalidArgumentError("a simulate task reads exactly one input \"tracked\"");
  }
  const base::Digest& tracked = *spec.inputs[0].digest;
  ASSIGN_OR_RETURN(const geometry::TrackedTake take, storage::ReadTrackedTake(store.ArtifactPath(tracked, spec.inputs[0].extension)));
  ASSIGN_OR_RETURN(const geometry::SimulatedTake result, Simulate(take, options.effect, progress));
  const storage::Provenance provenance{.kind = std::string(tasks::Name(spec.kind)),
                                       .key = spec.Key().Hex(),
                                       .kernel_version = tasks::KernelVersion(spec.kind),
                                       .options_json = spec.options.dump(),
                                       .seed = 0,
                                       .inputs = {fmt::format("tracked:{}", tracked.Hex())}};
  return storage::WriteSimulatedTake(output, result, provenance);
}

tasks::TaskSpec SimulateTask(const base::Digest& tracked_key, const nlohmann::json& canonical_effect) {
  tasks::TaskSpec spec;
  spec.kind = tasks::Kind::kSimulate;
  spec.options = tasks::ToJson(tasks::SimulateOptions{.effect = canonical_effect});
  spec.inputs.push_back({.role = "tracked", .source = tasks::Input::Source::kArtifact, .extension = ".h5", .digest = tracked_key});
  return spec;
}

}  // namespace vorocast::simulation
