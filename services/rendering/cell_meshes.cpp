// SPDX-License-Identifier: AGPL-3.0-or-later
#include <fmt/format.h>

#include <algorithm>

#include "services/base/check.h"
#include "services/geometry/polygon.h"
#include "services/rendering/palette.h"
#include "services/rendering/subjects.h"

namespace vorocast::rendering {
namespace {

using geometry::Cells;
using geometry::CellState;
using geometry::Rigid3;
using geometry::Vec3;
using geometry::Vec3f;

Vec3f Metal() { return {0.46F, 0.47F, 0.49F}; }
/// The skin stands out from the cut faces within.
constexpr float kSkinWhite = 0.10F;
constexpr float kCutDark = 0.72F;
/// Copies stand back behind the performer.
constexpr float kCopyWhite = 0.45F;

bool IsDrawn(const CellsPicture& picture, std::size_t cell) { return picture.state.empty() || picture.state[cell] != CellState::kGone; }

Rigid3 PoseOf(const CellsPicture& picture, std::size_t cell) {
  return picture.world_from_template.empty() ? Rigid3{} : picture.world_from_template[cell];
}

Vec3f ColourOf(const CellsPicture& picture, std::size_t cell) {
  const bool by_patch = picture.patch != nullptr && !picture.patch->empty();
  return PatchColour(by_patch ? (*picture.patch)[cell] : static_cast<std::int32_t>(cell));
}

/// A face's corners as indices into cells.vertices.
std::span<const std::int32_t> FaceLoop(const Cells& cells, std::int64_t face) {
  const auto begin = static_cast<std::size_t>(cells.vertex_offset[static_cast<std::size_t>(face)]);
  const auto end = static_cast<std::size_t>(cells.vertex_offset[static_cast<std::size_t>(face) + 1]);
  return {cells.vertex.data() + begin, end - begin};
}

/// How a cell is drawn beside its shape.
struct Look {
  Rigid3 pose;
  Vec3f colour;
  double scale;
};

void AppendCell(const Cells& cells, std::size_t cell, const Look& look, Triangles& mesh) {
  const auto& [pose, colour, scale] = look;
  const Vec3 centroid = cells.centroid[cell];
  std::vector<Vec3> corners;
  for (std::int64_t face = cells.face_offset[cell]; face < cells.face_offset[cell + 1]; ++face) {
    corners.clear();
    for (std::int32_t v : FaceLoop(cells, face))
      corners.push_back(pose * (centroid + scale * (cells.vertices[static_cast<std::size_t>(v)] - centroid)));
    const bool is_skin = cells.neighbour[static_cast<std::size_t>(face)] < 0;
    const Vec3f tint = is_skin ? Vec3f((1 - kSkinWhite) * colour + Vec3f::Constant(kSkinWhite)) : Vec3f(kCutDark * colour);
    for (const auto& triangle : geometry::Triangulate(corners)) {
      for (std::int32_t i : triangle) mesh.corners.push_back(corners[static_cast<std::size_t>(i)].cast<float>());
      mesh.colours.push_back(tint);
    }
  }
}

void AppendShape(const LooseShape& shape, const Vec3f& colour, double shrink, Triangles& mesh) {
  for (const auto& triangle : shape.mesh.triangles) {
    for (const std::int32_t v : triangle)
      mesh.corners.push_back((shape.middle + shrink * shape.mesh.vertices[static_cast<std::size_t>(v)]).cast<float>());
    mesh.colours.push_back(colour);
  }
}

Triangles MakeObject(const geometry::TriangleMesh& object, const Rigid3& world_from_object) {
  Triangles mesh;
  mesh.metal = true;
  for (const auto& triangle : object.triangles) {
    for (std::int32_t v : triangle) mesh.corners.push_back((world_from_object * object.vertices[static_cast<std::size_t>(v)]).cast<float>());
    mesh.colours.push_back(Metal());
  }
  return mesh;
}

}  // namespace

std::vector<Triangles> MakeMeshes(const CellsPicture& picture, double shrink) {
  std::vector<Triangles> meshes(1);
  for (std::size_t cell = 0; cell < picture.cells->size(); ++cell) {
    if (!IsDrawn(picture, cell)) continue;
    const double scale = picture.scale.empty() ? 1 : picture.scale[cell];
    AppendCell(*picture.cells, cell, {PoseOf(picture, cell), ColourOf(picture, cell), shrink * scale}, meshes[0]);
  }
  for (const CellCopy& copy : picture.copies) {
    const auto cell = static_cast<std::size_t>(copy.cell);
    const Vec3f pale = (1 - kCopyWhite) * ColourOf(picture, cell) + Vec3f::Constant(kCopyWhite);
    AppendCell(*picture.cells, cell, {copy.world_from_template, pale, shrink * copy.scale}, meshes[0]);
  }
  for (const LooseShape& shape : picture.shapes) AppendShape(shape, ColourOf(picture, static_cast<std::size_t>(shape.colour_of)), shrink, meshes[0]);
  for (const auto& [object, world_from_object] : picture.objects) meshes.push_back(MakeObject(*object, world_from_object));
  return meshes;
}

absl::Status CheckPicture(const CellsPicture& picture) {
  VOROCAST_CHECK(picture.cells != nullptr);
  const std::size_t n = picture.cells->size();
  if (picture.patch != nullptr && !picture.patch->empty() && picture.patch->size() != n) {
    return absl::InvalidArgumentError(fmt::format("{} cells have {} patch numbers", n, picture.patch->size()));
  }
  if (!picture.world_from_template.empty() && picture.world_from_template.size() != n) {
    return absl::InvalidArgumentError(fmt::format("{} cells have {} poses", n, picture.world_from_template.size()));
  }
  if (!picture.state.empty() && picture.state.size() != n)
    return absl::InvalidArgumentError(fmt::format("{} cells have {} states", n, picture.state.size()));
  if (!picture.scale.empty() && picture.scale.size() != n)
    return absl::InvalidArgumentError(fmt::format("{} cells have {} scales", n, picture.scale.size()));
  for (const CellCopy& copy : picture.copies) {
    if (copy.cell < 0 || static_cast<std::size_t>(copy.cell) >= n)
      return absl::InvalidArgumentError(fmt::format("a copy of cell {} of {}", copy.cell, n));
  }
  for (const LooseShape& shape : picture.shapes) {
    if (shape.colour_of < 0 || static_cast<std::size_t>(shape.colour_of) >= n)
      return absl::InvalidArgumentError(fmt::format("a shape with the colour of cell {} of {}", shape.colour_of, n));
  }
  for (std::size_t cell = 0; cell < picture.world_from_template.size(); ++cell) {
    const Rigid3& pose = picture.world_from_template[cell];
    if (!pose.translation.allFinite() || !pose.rotation.coeffs().allFinite()) {
      return absl::InvalidArgumentError(fmt::format("the pose of cell {} is not finite", cell));
    }
  }
  return absl::OkStatus();
}

void AddBounds(const CellsPicture& picture, Bounds& bounds) {
  const Cells& cells = *picture.cells;
  for (std::size_t cell = 0; cell < cells.size(); ++cell) {
    if (!IsDrawn(picture, cell)) continue;
    double squared = 0;
    for (std::int64_t face = cells.face_offset[cell]; face < cells.face_offset[cell + 1]; ++face) {
      for (std::int32_t v : FaceLoop(cells, face))
        squared = std::max(squared, (cells.vertices[static_cast<std::size_t>(v)] - cells.centroid[cell]).squaredNorm());
    }
    const bool loose = !picture.state.empty() && picture.state[cell] == geometry::CellState::kReleased;
    (loose ? bounds.debris : bounds.centres).push_back((PoseOf(picture, cell) * cells.centroid[cell]).cast<float>());
    (loose ? bounds.debris_radii : bounds.radii).push_back(static_cast<float>(std::sqrt(squared)));
  }
  for (const CellCopy& copy : picture.copies) {
    const auto cell = static_cast<std::size_t>(copy.cell);
    bounds.centres.push_back((copy.world_from_template * cells.centroid[cell]).cast<float>());
    bounds.radii.push_back(0.01F);
  }
  for (const LooseShape& shape : picture.shapes) {
    bounds.centres.push_back(shape.middle.cast<float>());
    bounds.radii.push_back(0.01F);
  }
  for (const auto& [object, world_from_object] : picture.objects) {
    for (const Vec3& v : object->vertices) bounds.companions.push_back((world_from_object * v).cast<float>());
  }
}

}  // namespace vorocast::rendering
