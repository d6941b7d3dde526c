// SPDX-License-Identifier: AGPL-3.0-or-later
#include "workers/agent/task_inputs.h"

#include <algorithm>
#include <utility>

#include <fmt/format.h>

namespace vorocast::agent {
namespace {

/// All frames of a coarse pass are in memory at once: together they may hold this many points, half a gigabyte.
constexpr std::size_t kSurfacePointsMax = 12'000'000;
constexpr std::size_t kInnerPointsMax = 4'000'000;
constexpr std::size_t kInnerPointsEnough = 1000;
/// Every iteration draws other points; so many times those of one are as good as all.
constexpr std::size_t kDraws = 4;

/// Every entry of an even choice of at most `most`.
template <typename T>
std::vector<T> Thinned(std::vector<T> values, std::size_t most) {
  if (values.size() <= most) return values;
  std::vector<T> kept;
  kept.reserve(most);
  for (std::size_t i = 0; i < most; ++i) kept.push_back(values[i * values.size() / most]);
  return kept;
}

}  // namespace

std::filesystem::path PathOf(const tasks::Input& input, const storage::ArtifactStore& store) {
  return input.source == tasks::Input::Source::kBlob ? store.BlobPath(*input.digest, input.extension)
                                                     : store.ArtifactPath(*input.digest, input.extension);
}

std::vector<const tasks::Input*> InputsOf(const tasks::TaskSpec& spec, std::string_view role) {
  std::vector<const tasks::Input*> inputs;
  for (const tasks::Input& input : spec.inputs) {
    if (input.role == role) inputs.push_back(&input);
  }
  return inputs;
}

absl::StatusOr<std::filesystem::path> PathOfOnly(const tasks::TaskSpec& spec, std::string_view role, const storage::ArtifactStore& store) {
  const std::vector<const tasks::Input*> inputs = InputsOf(spec, role);
  if (inputs.size() != 1 || !inputs[0]->digest) {
    return absl::InvalidArgumentError(fmt::format("a {} task reads exactly one input \"{}\", not {}", tasks::Name(spec.kind), role, inputs.size()));
  }
  return PathOf(*inputs[0], store);
}

storage::Provenance ProvenanceOf(const tasks::TaskSpec& spec, std::uint64_t seed) {
  storage::Provenance provenance{
      std::string(tasks::Name(spec.kind)), spec.Key().Hex(), tasks::KernelVersion(spec.kind), spec.options.dump(), seed, {}};
  for (const tasks::Input& input : spec.inputs) {
    provenance.inputs.push_back(fmt::format("{}:{}", input.role, input.digest ? input.digest->Hex() : "missing"));
  }
  return provenance;
}

absl::StatusOr<tracking::Observation> ObservationOf(const tasks::Input& input, const storage::ArtifactStore& store, std::size_t surface_max,
                                                    std::size_t inner_max) {
  tracking::Observation observation;
  observation.frame = input.frame;
  observation.missing = !input.digest.has_value();
  if (observation.missing) return observation;
  absl::StatusOr<storage::ObservedCells> observed = storage::ReadObservedCells(PathOf(input, store));
  if (!observed.ok()) return base::Annotate(observed.status(), fmt::format("frame {}", input.frame));
  observation.surface.positions = Thinned(std::move(observed->surface.positions), surface_max);
  observation.surface.normals = Thinned(std::move(observed->surface.normals), surface_max);
  observation.inner = Thinned(std::move(observed->centroid), inner_max);
  observation.inner_depth = Thinned(std::move(observed->depth), inner_max);
  return observation;
}

absl::StatusOr<std::vector<tracking::Observation>> CoarseObservationsOf(const std::vector<const tasks::Input*>& inputs,
                                                                        const storage::ArtifactStore& store, std::int32_t points,
                                                                        const base::Progress& progress) {
  const std::size_t count = std::max<std::size_t>(inputs.size(), 1);
  const auto drawn = static_cast<std::size_t>(points);
  const std::size_t surface_max = std::max(drawn, std::min(kDraws * drawn, kSurfacePointsMax / count));
  const std::size_t inner_max = std::max(kInnerPointsEnough, kInnerPointsMax / count);
  std::vector<tracking::Observation> frames;
  for (const tasks::Input* input : inputs) {
    ASSIGN_OR_RETURN(tracking::Observation observation, ObservationOf(*input, store, surface_max, inner_max));
    frames.push_back(std::move(observation));
    base::Report(progress, static_cast<double>(frames.size()) / static_cast<double>(count));
  }
  return frames;
}

absl::StatusOr<std::vector<geometry::Stretch>> ReadStretches(const tasks::TaskSpec& spec, const storage::ArtifactStore& store) {
  std::vector<geometry::Stretch> stretches;
  for (const tasks::Input* input : InputsOf(spec, "stretch")) {
    if (!input->digest) return absl::InvalidArgumentError(fmt::format("stretch {} is missing", stretches.size()));
    ASSIGN_OR_RETURN(geometry::Stretch stretch, storage::ReadStretch(PathOf(*input, store)));
    stretches.push_back(std::move(stretch));
  }
  return stretches;
}

base::Progress Part(const base::Progress& whole, double begin, double end) {
  if (!whole) return whole;
  return [=](double fraction) { whole(begin + (end - begin) * fraction); };
}

}  // namespace vorocast::agent
