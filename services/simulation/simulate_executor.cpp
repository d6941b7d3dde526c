// SPDX-License-Identifier: AGPL-3.0-or-later
#include "services/simulation/simulate_executor.h"

#include <fmt/format.h>

#include <optional>

#include "services/simulation/simulate.h"
#include "services/storage/hdf5_artifacts.h"
#include "services/tasks/options.h"

namespace vorocast::simulation {

absl::Status SimulateExecutor::Execute(const tasks::TaskSpec& spec, const storage::ArtifactStore& store, const std::filesystem::path& output,
                                       const base::Progress& progress) {
  tasks::SimulateOptions options;
  RETURN_IF_ERROR(FromJson(spec.options, options));
  const auto is = [&](std::size_t i, const char* role) { return spec.inputs[i].role == role && spec.inputs[i].digest; };
  const std::size_t inputs = spec.inputs.size();
  if (inputs < 1 || inputs > 2 || !is(0, "tracked") || (inputs == 2 && !is(1, "target"))) {
    return absl::InvalidArgumentError("a simulate task reads one input \"tracked\", and for a morph a second one \"target\"");
  }
  const base::Digest& tracked = *spec.inputs[0].digest;
  ASSIGN_OR_RETURN(const geometry::TrackedTake take, storage::ReadTrackedTake(store.ArtifactPath(tracked, spec.inputs[0].extension)));
  std::optional<geometry::TrackedTake> target;
  std::vector<std::string> names = {fmt::format("tracked:{}", tracked.Hex())};
  if (inputs == 2) {
    ASSIGN_OR_RETURN(target, storage::ReadTrackedTake(store.ArtifactPath(*spec.inputs[1].digest, spec.inputs[1].extension)));
    names.push_back(fmt::format("target:{}", spec.inputs[1].digest->Hex()));
  }
  ASSIGN_OR_RETURN(const geometry::SimulatedTake result, Simulate(take, options.effect, progress, {}, target ? &*target : nullptr));
  // To the log of the process that holds the lease.
  fmt::print(stderr,
             "deepest penetration: cells {:.1f} mm (overlapping when they began to collide: {:.1f} mm), objects {:.1f} mm, ground {:.1f} mm\n",
             1e3 * result.cell_penetration_m, 1e3 * result.cell_overlap_m, 1e3 * result.object_penetration_m, 1e3 * result.ground_penetration_m);
  const storage::Provenance provenance{.kind = std::string(tasks::Name(spec.kind)),
                                       .key = spec.Key().Hex(),
                                       .kernel_version = tasks::KernelVersion(spec.kind),
                                       .options_json = spec.options.dump(),
                                       .seed = 0,
                                       .inputs = std::move(names)};
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
