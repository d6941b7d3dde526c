// SPDX-License-Identifier: AGPL-3.0-or-later
// simulated.h5.
#include <algorithm>
#include <array>
#include <utility>

#include "services/storage/artifact_file.h"
#include "services/storage/faults.h"
#include "services/storage/pose_arrays.h"

namespace vorocast::storage {

using geometry::CellState;
using geometry::SceneObject;
using geometry::SimulatedTake;
using geometry::Vec3;

namespace {

static_assert(sizeof(CellState) == sizeof(std::uint8_t));
using Triangle = std::array<std::int32_t, 3>;

/// All objects' meshes one after another, with offsets.
void WriteObjectShapes(Hdf5Writer& writer, const std::vector<SceneObject>& objects) {
  std::vector<std::string> names;
  std::vector<std::int64_t> vertex_offset = {0};
  std::vector<std::int64_t> triangle_offset = {0};
  std::vector<Vec3> vertices;
  std::vector<Triangle> triangles;
  for (const SceneObject& object : objects) {
    names.push_back(object.name);
    vertices.insert(vertices.end(), object.mesh.vertices.begin(), object.mesh.vertices.end());
    triangles.insert(triangles.end(), object.mesh.triangles.begin(), object.mesh.triangles.end());
    vertex_offset.push_back(static_cast<std::int64_t>(vertices.size()));
    triangle_offset.push_back(static_cast<std::int64_t>(triangles.size()));
  }
  writer.Strings("/objects/name", names);
  writer.Dataset<std::int64_t>("/objects/vertex_offset", {vertex_offset.size()}, vertex_offset.data());
  writer.Dataset<double>("/objects/vertices", {vertices.size(), 3}, reinterpret_cast<const double*>(vertices.data()));
  writer.Dataset<std::int64_t>("/objects/triangle_offset", {triangle_offset.size()}, triangle_offset.data());
  writer.Dataset<std::int32_t>("/objects/triangles", {triangles.size(), 3}, reinterpret_cast<const std::int32_t*>(triangles.data()));
}

void WriteCopies(Hdf5Writer& writer, const geometry::CellCopies& copies) {
  if (copies.offset.empty()) return;
  const hsize_t rows = copies.cell.size();
  writer.Group("/copies");
  writer.Dataset<std::int64_t>("/copies/offset", {copies.offset.size()}, copies.offset.data());
  writer.Dataset<std::int32_t>("/copies/copy", {rows}, copies.copy.data());
  writer.Dataset<std::int32_t>("/copies/cell", {rows}, copies.cell.data());
  writer.Dataset<float>("/copies/rotation", {rows, 4}, reinterpret_cast<const float*>(copies.rotation.data()));
  writer.Dataset<float>("/copies/translation", {rows, 3}, reinterpret_cast<const float*>(copies.translation.data()));
  writer.Dataset<float>("/copies/scale", {rows}, copies.scale.data());
}

absl::StatusOr<geometry::CellCopies> ReadCopies(const Hdf5Reader& reader, std::int64_t steps) {
  geometry::CellCopies copies;
  if (!reader.Has("/copies")) return copies;
  ASSIGN_OR_RETURN(copies.offset, reader.Dataset<std::int64_t>("/copies/offset", {steps + 1}));
  ASSIGN_OR_RETURN(copies.cell, reader.Dataset<std::int32_t>("/copies/cell", {kAny}));
  const auto rows = static_cast<std::int64_t>(copies.cell.size());
  ASSIGN_OR_RETURN(copies.copy, reader.Dataset<std::int32_t>("/copies/copy", {rows}));
  ASSIGN_OR_RETURN(copies.rotation, (reader.Rows<float, float, 4, Eigen::Vector4f>("/copies/rotation", {rows})));
  ASSIGN_OR_RETURN(copies.translation, (reader.Rows<float, float, 3, geometry::Vec3f>("/copies/translation", {rows})));
  ASSIGN_OR_RETURN(copies.scale, reader.Dataset<float>("/copies/scale", {rows}));
  return copies;
}

void WriteMorph(Hdf5Writer& writer, const geometry::CellMorphs& morph, hsize_t steps) {
  if (morph.vertex_offset.empty()) return;
  const hsize_t pairs = morph.source.size();
  writer.Group("/morph");
  writer.Dataset<std::int32_t>("/morph/source", {pairs}, morph.source.data());
  writer.Dataset<std::int32_t>("/morph/target", {pairs}, morph.target.data());
  writer.Dataset<std::int64_t>("/morph/vertex_offset", {morph.vertex_offset.size()}, morph.vertex_offset.data());
  writer.Dataset<float>("/morph/from", {morph.from.size(), 3}, reinterpret_cast<const double*>(morph.from.data()));
  writer.Dataset<float>("/morph/to", {morph.to.size(), 3}, reinterpret_cast<const double*>(morph.to.data()));
  writer.Dataset<std::int64_t>("/morph/triangle_offset", {morph.triangle_offset.size()}, morph.triangle_offset.data());
  writer.Dataset<std::int32_t>("/morph/triangles", {morph.triangles.size(), 3}, reinterpret_cast<const std::int32_t*>(morph.triangles.data()));
  writer.Dataset<float>("/morph/blend", {steps, pairs}, morph.blend.data());
  writer.Dataset<float>("/morph/scale", {steps, pairs}, morph.scale.data());
  writer.Dataset<float>("/morph/rotation", {steps, pairs, 4}, reinterpret_cast<const float*>(morph.rotation.data()));
  writer.Dataset<float>("/morph/translation", {steps, pairs, 3}, reinterpret_cast<const float*>(morph.translation.data()));
}

absl::StatusOr<geometry::CellMorphs> ReadMorph(const Hdf5Reader& reader, std::int64_t steps) {
  geometry::CellMorphs morph;
  if (!reader.Has("/morph")) return morph;
  ASSIGN_OR_RETURN(morph.source, reader.Dataset<std::int32_t>("/morph/source", {kAny}));
  const auto pairs = static_cast<std::int64_t>(morph.source.size());
  ASSIGN_OR_RETURN(morph.target, reader.Dataset<std::int32_t>("/morph/target", {pairs}));
  ASSIGN_OR_RETURN(morph.vertex_offset, reader.Dataset<std::int64_t>("/morph/vertex_offset", {pairs + 1}));
  ASSIGN_OR_RETURN(morph.from, (reader.Rows<float, double, 3, Vec3>("/morph/from", {kAny})));
  ASSIGN_OR_RETURN(morph.to, (reader.Rows<float, double, 3, Vec3>("/morph/to", {static_cast<std::int64_t>(morph.from.size())})));
  ASSIGN_OR_RETURN(morph.triangle_offset, reader.Dataset<std::int64_t>("/morph/triangle_offset", {pairs + 1}));
  ASSIGN_OR_RETURN(morph.triangles, (reader.Rows<std::int32_t, std::int32_t, 3, Triangle>("/morph/triangles", {kAny})));
  ASSIGN_OR_RETURN(morph.blend, reader.Dataset<float>("/morph/blend", {steps, pairs}));
  ASSIGN_OR_RETURN(morph.scale, reader.Dataset<float>("/morph/scale", {steps, pairs}));
  ASSIGN_OR_RETURN(morph.rotation, (reader.Rows<float, float, 4, Eigen::Vector4f>("/morph/rotation", {steps, pairs})));
  ASSIGN_OR_RETURN(morph.translation, (reader.Rows<float, float, 3, geometry::Vec3f>("/morph/translation", {steps, pairs})));
  return morph;
}

bool AreOffsets(const std::vector<std::int64_t>& offsets, std::size_t end) {
  return offsets.front() == 0 && std::cmp_equal(offsets.back(), end) && std::is_sorted(offsets.begin(), offsets.end());
}

absl::StatusOr<std::vector<SceneObject>> ReadObjectShapes(const Hdf5Reader& reader) {
  ASSIGN_OR_RETURN(const auto names, reader.Strings("/objects/name", {kAny}));
  const auto count = static_cast<std::int64_t>(names.size());
  ASSIGN_OR_RETURN(const auto vertex_offset, reader.Dataset<std::int64_t>("/objects/vertex_offset", {count + 1}));
  ASSIGN_OR_RETURN(const auto vertices, (reader.Rows<double, double, 3, Vec3>("/objects/vertices", {kAny})));
  ASSIGN_OR_RETURN(const auto triangle_offset, reader.Dataset<std::int64_t>("/objects/triangle_offset", {count + 1}));
  ASSIGN_OR_RETURN(const auto triangles, (reader.Rows<std::int32_t, std::int32_t, 3, Triangle>("/objects/triangles", {kAny})));
  if (!AreOffsets(vertex_offset, vertices.size())) return reader.Wrong("/objects/vertex_offset", "does not ascend from 0 to the number of vertices");
  if (!AreOffsets(triangle_offset, triangles.size())) {
    return reader.Wrong("/objects/triangle_offset", "does not ascend from 0 to the number of triangles");
  }
  std::vector<SceneObject> objects(names.size());
  for (std::size_t i = 0; i < objects.size(); ++i) {
    objects[i].name = names[i];
    objects[i].mesh.vertices.assign(vertices.begin() + vertex_offset[i], vertices.begin() + vertex_offset[i + 1]);
    objects[i].mesh.triangles.assign(triangles.begin() + triangle_offset[i], triangles.begin() + triangle_offset[i + 1]);
  }
  return objects;
}

}  // namespace

absl::Status WriteSimulatedTake(const std::filesystem::path& path, const SimulatedTake& take, const Provenance& provenance) {
  RETURN_IF_ERROR(RefuseToWrite(path, FaultIn(take)));
  const hsize_t steps = take.time.size();
  const hsize_t cells = steps == 0 ? 0 : take.cell_state.size() / steps;
  Hdf5Writer writer(path);
  WriteRoot(writer, kSimulatedContent, provenance);
  writer.Attribute("/", "effect", take.effect_json);
  writer.Attribute("/", "cell_penetration_m", take.cell_penetration_m);
  writer.Attribute("/", "cell_overlap_m", take.cell_overlap_m);
  writer.Attribute("/", "object_penetration_m", take.object_penetration_m);
  writer.Attribute("/", "ground_penetration_m", take.ground_penetration_m);
  writer.Dataset<double>("/time", {steps}, take.time.data());
  writer.Group("/cells");
  WriteCellPoses(writer, {steps, cells}, take.cell_rotation, take.cell_translation);
  writer.Dataset<std::uint8_t>("/cells/state", {steps, cells}, reinterpret_cast<const std::uint8_t*>(take.cell_state.data()));
  if (!take.cell_scale.empty()) writer.Dataset<float>("/cells/scale", {steps, cells}, take.cell_scale.data());
  WriteCopies(writer, take.copies);
  WriteMorph(writer, take.morph, steps);
  writer.Group("/objects");
  WriteObjectShapes(writer, take.objects);
  WritePoses(writer, "/objects", {steps, take.objects.size()}, take.object_pose);
  return writer.Finish();
}

absl::StatusOr<SimulatedTake> ReadSimulatedTake(const std::filesystem::path& path) {
  ASSIGN_OR_RETURN(const Hdf5Reader reader, OpenArtifact(path, kSimulatedContent));
  SimulatedTake take;
  ASSIGN_OR_RETURN(take.effect_json, reader.TextAttribute("/", "effect"));
  // Files of earlier kernels do not have these.
  const auto metres = [&](const char* name) { return reader.Attribute<double>("/", name).value_or(0); };
  take.cell_penetration_m = metres("cell_penetration_m");
  take.cell_overlap_m = metres("cell_overlap_m");
  take.object_penetration_m = metres("object_penetration_m");
  take.ground_penetration_m = metres("ground_penetration_m");
  ASSIGN_OR_RETURN(take.time, reader.Dataset<double>("/time", {kAny}));
  const auto steps = static_cast<std::int64_t>(take.time.size());
  ASSIGN_OR_RETURN(const Shape shape, reader.ShapeOf<std::uint8_t>("/cells/state", {steps, kAny}));
  ASSIGN_OR_RETURN(const auto state, reader.Dataset<std::uint8_t>("/cells/state", shape));
  take.cell_state.reserve(state.size());
  for (const std::uint8_t value : state) take.cell_state.push_back(static_cast<CellState>(value));
  RETURN_IF_ERROR(ReadCellPoses(reader, shape, take.cell_rotation, take.cell_translation));
  if (reader.Has("/cells/scale")) {
    ASSIGN_OR_RETURN(take.cell_scale, reader.Dataset<float>("/cells/scale", shape));
  }
  ASSIGN_OR_RETURN(take.copies, ReadCopies(reader, steps));
  ASSIGN_OR_RETURN(take.morph, ReadMorph(reader, steps));
  ASSIGN_OR_RETURN(take.objects, ReadObjectShapes(reader));
  ASSIGN_OR_RETURN(take.object_pose, ReadPoses(reader, "/objects", {steps, static_cast<std::int64_t>(take.objects.size())}));
  if (const std::string fault = FaultIn(take); !fault.empty()) return reader.Wrong("values", fault);
  return take;
}

absl::StatusOr<bool> HoldsSimulatedTake(const std::filesystem::path& path) {
  ASSIGN_OR_RETURN(const std::string content, ReadContent(path));
  return content == kSimulatedContent;
}

}  // namespace vorocast::storage
