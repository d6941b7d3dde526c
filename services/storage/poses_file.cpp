// SPDX-License-Identifier: AGPL-3.0-or-later
// stretch.h5, guide.h5, window.h5 and tracked.h5.
#include <algorithm>

#include "services/storage/artifact_file.h"
#include "services/storage/cells_layout.h"
#include "services/storage/faults.h"
#include "services/storage/pose_arrays.h"

namespace vorocast::storage {

using geometry::FrameState;
using geometry::PoseTrack;
using geometry::Stretch;
using geometry::TrackedTake;
using geometry::Vec3;

namespace {

static_assert(sizeof(FrameState) == sizeof(std::uint8_t));

void WritePoseTrackLayout(Hdf5Writer& writer, const PoseTrack& track) {
  const hsize_t frames = track.frames.size();
  writer.Dataset<std::int32_t>("/frames", {frames}, track.frames.data());
  writer.Dataset<std::uint8_t>("/frame_state", {frames}, reinterpret_cast<const std::uint8_t*>(track.state.data()));
  writer.Dataset<double>("/frame_residual", {frames}, track.residual.data());
  writer.Dataset<double>("/frame_confidence", {frames}, track.confidence.data());
  writer.Group("/patches");
  WritePoses(writer, "/patches", {frames, static_cast<hsize_t>(track.patch_count)}, track.world_from_template);
}

std::string FaultIn(const Stretch& stretch) {
  const auto finite = [](const Vec3& x) { return x.allFinite(); };
  if (stretch.frame < 0) return "/@frame: is negative";
  if (stretch.centroid.empty() || stretch.patch.size() != stretch.centroid.size()) return "/stretch: its cells do not each have a patch";
  if (!std::ranges::all_of(stretch.centroid, finite)) return "/stretch/centroid: a value is not finite";
  const auto outside = [&](std::int32_t patch) { return patch < 0 || patch >= stretch.motion.patch_count; };
  if (std::ranges::any_of(stretch.patch, outside)) return "/stretch/patch: a cell's patch has no poses";
  return storage::FaultIn(stretch.motion);
}

absl::StatusOr<PoseTrack> ReadPoseTrackLayout(const Hdf5Reader& reader) {
  PoseTrack track;
  ASSIGN_OR_RETURN(track.frames, reader.Dataset<std::int32_t>("/frames", {kAny}));
  const auto frames = static_cast<std::int64_t>(track.frames.size());
  ASSIGN_OR_RETURN(const auto state, reader.Dataset<std::uint8_t>("/frame_state", {frames}));
  for (const std::uint8_t value : state) track.state.push_back(static_cast<FrameState>(value));
  ASSIGN_OR_RETURN(track.residual, reader.Dataset<double>("/frame_residual", {frames}));
  ASSIGN_OR_RETURN(track.confidence, reader.Dataset<double>("/frame_confidence", {frames}));
  ASSIGN_OR_RETURN(const Shape shape, reader.ShapeOf<double>("/patches/rotation", {frames, kAny, 4}));
  if (shape[1] > kPatchesMax) return reader.Wrong("/patches/rotation", "has too many patches");
  track.patch_count = static_cast<std::int32_t>(shape[1]);
  ASSIGN_OR_RETURN(track.world_from_template, ReadPoses(reader, "/patches", {frames, shape[1]}));
  return track;
}

}  // namespace

absl::Status WritePoseTrack(const std::filesystem::path& path, const PoseTrack& track, const Provenance& provenance) {
  RETURN_IF_ERROR(RefuseToWrite(path, FaultIn(track)));
  Hdf5Writer writer(path);
  WriteRoot(writer, kPosesContent, provenance);
  WritePoseTrackLayout(writer, track);
  if (!track.cell_pose.empty()) {
    writer.Group("/cells");
    WritePoses(writer, "/cells", {track.frames.size(), track.cell_pose.size() / track.frames.size()}, track.cell_pose);
  }
  return writer.Finish();
}

absl::StatusOr<PoseTrack> ReadPoseTrack(const std::filesystem::path& path) {
  ASSIGN_OR_RETURN(const Hdf5Reader reader, OpenArtifact(path, kPosesContent));
  ASSIGN_OR_RETURN(PoseTrack track, ReadPoseTrackLayout(reader));
  if (reader.Has("/cells")) {
    ASSIGN_OR_RETURN(track.cell_pose, ReadPoses(reader, "/cells", {static_cast<std::int64_t>(track.frames.size()), kAny}));
  }
  if (const std::string fault = FaultIn(track); !fault.empty()) return reader.Wrong("values", fault);
  return track;
}

absl::Status WriteStretch(const std::filesystem::path& path, const Stretch& stretch, const Provenance& provenance) {
  RETURN_IF_ERROR(RefuseToWrite(path, FaultIn(stretch)));
  const hsize_t cells = stretch.centroid.size();
  Hdf5Writer writer(path);
  WriteRoot(writer, kStretchContent, provenance);
  writer.Attribute("/", "frame", stretch.frame);
  writer.Group("/stretch");
  writer.Dataset<double>("/stretch/centroid", {cells, 3}, reinterpret_cast<const double*>(stretch.centroid.data()));
  writer.Dataset<std::int32_t>("/stretch/patch", {cells}, stretch.patch.data());
  WritePoseTrackLayout(writer, stretch.motion);
  return writer.Finish();
}

absl::StatusOr<Stretch> ReadStretch(const std::filesystem::path& path) {
  ASSIGN_OR_RETURN(const Hdf5Reader reader, OpenArtifact(path, kStretchContent));
  Stretch stretch;
  ASSIGN_OR_RETURN(stretch.frame, reader.Attribute<std::int32_t>("/", "frame"));
  ASSIGN_OR_RETURN(stretch.centroid, (reader.Rows<double, double, 3, Vec3>("/stretch/centroid", {kAny})));
  ASSIGN_OR_RETURN(stretch.patch, reader.Dataset<std::int32_t>("/stretch/patch", {static_cast<std::int64_t>(stretch.centroid.size())}));
  ASSIGN_OR_RETURN(stretch.motion, ReadPoseTrackLayout(reader));
  if (const std::string fault = FaultIn(stretch); !fault.empty()) return reader.Wrong("values", fault);
  return stretch;
}

absl::Status WriteTrackedTake(const std::filesystem::path& path, const TrackedTake& take, const Provenance& provenance) {
  RETURN_IF_ERROR(RefuseToWrite(path, FaultIn(take)));
  Hdf5Writer writer(path);
  WriteRoot(writer, kTrackedContent, provenance);
  writer.Attribute("/", "frames_per_second", take.frames_per_second);
  writer.Group("/template");
  WriteTemplateLayout(writer, "/template", take.model);
  WritePoseTrackLayout(writer, take.patches);
  writer.Group("/cells");
  WriteCellPoses(writer, {take.frame_count(), take.cell_count()}, take.cell_rotation, take.cell_translation);
  return writer.Finish();
}

absl::StatusOr<TrackedTake> ReadTrackedTake(const std::filesystem::path& path) {
  ASSIGN_OR_RETURN(const Hdf5Reader reader, OpenArtifact(path, kTrackedContent));
  TrackedTake take;
  ASSIGN_OR_RETURN(take.frames_per_second, reader.Attribute<double>("/", "frames_per_second"));
  ASSIGN_OR_RETURN(take.model, ReadTemplateLayout(reader, "/template"));
  ASSIGN_OR_RETURN(take.patches, ReadPoseTrackLayout(reader));
  const Shape shape = {static_cast<std::int64_t>(take.frame_count()), static_cast<std::int64_t>(take.cell_count())};
  RETURN_IF_ERROR(ReadCellPoses(reader, shape, take.cell_rotation, take.cell_translation));
  if (const std::string fault = FaultIn(take); !fault.empty()) return reader.Wrong("values", fault);
  return take;
}

}  // namespace vorocast::storage
