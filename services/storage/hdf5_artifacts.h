// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "services/base/status.h"
#include "services/geometry/simulated_take.h"
#include "services/geometry/stretch.h"
#include "services/geometry/tracked_take.h"

/// The HDF5 files of docs/storage_format.md. Writers write the same bytes for the same content. Readers believe nothing: every shape,
/// offset and index is checked against the file's size and against each other before memory is taken; an error names file and dataset.
namespace vorocast::storage {

/// Where an artifact came from; attributes of the file's root group.
struct Provenance {
  std::string kind;  // task kind
  std::string key;   // hexadecimal key of the task
  int kernel_version = 0;
  std::string options_json;  // canonical JSON
  std::uint64_t seed = 0;
  std::vector<std::string> inputs;  // "role:hex", in the task's order
};

absl::Status WriteCells(const std::filesystem::path& path, const geometry::Cells& cells, const Provenance& provenance);
absl::StatusOr<geometry::Cells> ReadCells(const std::filesystem::path& path);

/// The head of a cells.h5, without its arrays.
struct CellsSummary {
  double energy = 0;        // m⁵
  double surface_area = 0;  // m²
  std::int32_t iterations = 0;
  std::int64_t cell_count = 0;
};
absl::StatusOr<CellsSummary> ReadCellsSummary(const std::filesystem::path& path);

/// The part of a cells.h5 that tracking looks at: a third of the file.
struct ObservedCells {
  geometry::OrientedPoints surface;
  std::vector<geometry::Vec3> centroid;  // [n]
  std::vector<double> depth;             // [n] metres
};
absl::StatusOr<ObservedCells> ReadObservedCells(const std::filesystem::path& path);

/// template.h5: the cells layout, /patch [n] i4, root attribute frame.
absl::Status WriteTemplate(const std::filesystem::path& path, const geometry::Template& model, const Provenance& provenance);
absl::StatusOr<geometry::Template> ReadTemplate(const std::filesystem::path& path);

/// guide.h5 and window.h5: /frames, /frame_state, /frame_residual, /frame_confidence, /patches/rotation, /patches/translation.
absl::Status WritePoseTrack(const std::filesystem::path& path, const geometry::PoseTrack& track, const Provenance& provenance);
absl::StatusOr<geometry::PoseTrack> ReadPoseTrack(const std::filesystem::path& path);

/// stretch.h5: the layout of poses, /stretch/centroid, /stretch/patch, root attribute frame.
absl::Status WriteStretch(const std::filesystem::path& path, const geometry::Stretch& stretch, const Provenance& provenance);
absl::StatusOr<geometry::Stretch> ReadStretch(const std::filesystem::path& path);

absl::Status WriteTrackedTake(const std::filesystem::path& path, const geometry::TrackedTake& take, const Provenance& provenance);
absl::StatusOr<geometry::TrackedTake> ReadTrackedTake(const std::filesystem::path& path);

absl::Status WriteSimulatedTake(const std::filesystem::path& path, const geometry::SimulatedTake& take, const Provenance& provenance);
absl::StatusOr<geometry::SimulatedTake> ReadSimulatedTake(const std::filesystem::path& path);
/// Whether the artifact is a simulated.h5; format and version checked.
absl::StatusOr<bool> HoldsSimulatedTake(const std::filesystem::path& path);

/// Opens the file, checks its format version, and checks that every dataset can be read whole. Used before a result is published.
absl::Status CheckArtifact(const std::filesystem::path& path);
absl::StatusOr<Provenance> ReadProvenance(const std::filesystem::path& path);

}  // namespace vorocast::storage
