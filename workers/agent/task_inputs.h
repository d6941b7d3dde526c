// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <filesystem>
#include <string_view>
#include <vector>

#include "services/base/status.h"
#include "services/storage/artifact_store.h"
#include "services/storage/hdf5_artifacts.h"
#include "services/tasks/task.h"
#include "workers/tracking/tracking.h"

/// What executors have in common: finding a task's inputs and naming where its result came from.
namespace vorocast::agent {

std::filesystem::path PathOf(const tasks::Input& input, const storage::ArtifactStore& store);

/// The inputs of a role, in the task's order.
std::vector<const tasks::Input*> InputsOf(const tasks::TaskSpec& spec, std::string_view role);
/// The path of the one input of a role. INVALID_ARGUMENT unless there is exactly one and it is not missing.
absl::StatusOr<std::filesystem::path> PathOfOnly(const tasks::TaskSpec& spec, std::string_view role, const storage::ArtifactStore& store);

/// Reads the options into their struct. INVALID_ARGUMENT names the field.
template <typename Options>
absl::StatusOr<Options> OptionsOf(const tasks::TaskSpec& spec) {
  Options options;
  RETURN_IF_ERROR(FromJson(spec.options, options));
  return options;
}

/// `seed`: of the kernel, or 0 where it uses none.
storage::Provenance ProvenanceOf(const tasks::TaskSpec& spec, std::uint64_t seed);

/// What tracking sees of one frame's "cells" input; `missing` where the input is. Of the surface and of the inner points at most so many are
/// kept, evenly: a pass over thousands of frames holds them all.
absl::StatusOr<tracking::Observation> ObservationOf(const tasks::Input& input, const storage::ArtifactStore& store, std::size_t surface_max,
                                                    std::size_t inner_max);

/// The same of many frames for a coarse pass, which draws `points` surface points a frame at a time: a few times as many, and bounded however long
/// the take.
absl::StatusOr<std::vector<tracking::Observation>> CoarseObservationsOf(const std::vector<const tasks::Input*>& inputs,
                                                                        const storage::ArtifactStore& store, std::int32_t points,
                                                                        const base::Progress& progress);

/// The task's inputs of the role "stretch". INVALID_ARGUMENT for one that is missing.
absl::StatusOr<std::vector<geometry::Stretch>> ReadStretches(const tasks::TaskSpec& spec, const storage::ArtifactStore& store);

/// A part of a longer task's progress: 0 … 1 becomes begin … end.
base::Progress Part(const base::Progress& whole, double begin, double end);

}  // namespace vorocast::agent
