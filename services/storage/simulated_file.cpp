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
  writer.Dataset<double>("/time", {steps}, take.time.data());
  writer.Group("/cells");
  WriteCellPoses(writer, {steps, cells}, take.cell_rotation, take.cell_translation);
  writer.Dataset<std::uint8_t>("/cells/state", {steps, cells}, reinterpret_cast<const std::uint8_t*>(take.cell_state.data()));
  writer.Group("/objects");
  WriteObjectShapes(writer, take.objects);
  WritePoses(writer, "/objects", {steps, take.objects.size()}, take.object_pose);
  return writer.Finish();
}

absl::StatusOr<SimulatedTake> ReadSimulatedTake(const std::filesystem::path& path) {
  ASSIGN_OR_RETURN(const Hdf5Reader reader, OpenArtifact(path, kSimulatedContent));
  SimulatedTake take;
  ASSIGN_OR_RETURN(take.effect_json, reader.TextAttribute("/", "effect"));
  ASSIGN_OR_RETURN(take.time, reader.Dataset<double>("/time", {kAny}));
  const auto steps = static_cast<std::int64_t>(take.time.size());
  ASSIGN_OR_RETURN(const Shape shape, reader.ShapeOf<std::uint8_t>("/cells/state", {steps, kAny}));
  ASSIGN_OR_RETURN(const auto state, reader.Dataset<std::uint8_t>("/cells/state", shape));
  take.cell_state.reserve(state.size());
  for (const std::uint8_t value : state) take.cell_state.push_back(static_cast<CellState>(value));
  RETURN_IF_ERROR(ReadCellPoses(reader, shape, take.cell_rotation, take.cell_translation));
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
