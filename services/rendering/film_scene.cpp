// SPDX-License-Identifier: AGPL-3.0-or-later
#include "services/rendering/film_scene.h"

#include <algorithm>
#include <span>

#include <fmt/format.h>
#include <nanoflann.hpp>

#include "services/geometry/polygon.h"
#include "services/rendering/palette.h"

namespace vorocast::rendering {
namespace {

using geometry::Cells;
using geometry::CellState;
using geometry::Vec3;
using geometry::Vec3f;

/// Cut faces show the inside: redder and darker than the skin.
Vec3f CutColour(const Vec3f& skin) { return 0.55F * skin + Vec3f(0.08F, 0.015F, 0.01F); }
Vec3f ObjectColour() { return {0.46F, 0.47F, 0.49F}; }
/// Cells are drawn a little smaller than they are, so that seams show as fine lines and faces that touch do not fight.
constexpr double kShrink = 0.998;

struct MeshWithIds {
  Triangles triangles;
  std::vector<std::int32_t> ids;

  void Add(std::span<const Vec3> corners, const Motion& motion, bool moving, const Vec3f& colour, std::int32_t id) {
    for (const auto& triangle : geometry::Triangulate(corners)) {
      for (const std::int32_t i : triangle) {
        const Vec3& corner = corners[static_cast<std::size_t>(i)];
        triangles.corners.push_back((motion.at_open * corner).cast<float>());
        if (moving) triangles.corners_at_close.push_back((motion.at_close * corner).cast<float>());
      }
      triangles.colours.push_back(colour);
      ids.push_back(id);
    }
  }
};

void AddCell(const FilmSubject& subject, std::size_t cell, bool moving, MeshWithIds& mesh) {
  const Cells& cells = *subject.cells;
  const double size = kShrink * (subject.scale.empty() ? 1 : static_cast<double>(subject.scale[cell]));
  const Vec3f skin = subject.colour ? (*subject.colour)[cell] : PatchColour(subject.patch ? (*subject.patch)[cell] : static_cast<std::int32_t>(cell));
  const Vec3 centroid = cells.centroid[cell];
  std::vector<Vec3> corners;
  for (std::int64_t f = cells.face_offset[cell]; f < cells.face_offset[cell + 1]; ++f) {
    const auto face = static_cast<std::size_t>(f);
    corners.clear();
    for (std::int64_t i = cells.vertex_offset[face]; i < cells.vertex_offset[face + 1]; ++i) {
      const Vec3& vertex = cells.vertices[static_cast<std::size_t>(cells.vertex[static_cast<std::size_t>(i)])];
      corners.push_back(centroid + size * (vertex - centroid));
    }
    mesh.Add(corners, subject.motion[cell], moving, cells.neighbour[face] < 0 ? skin : CutColour(skin), static_cast<std::int32_t>(cell));
  }
}

void AddObject(const geometry::SceneObject& object, const Motion& motion, bool moving, std::int32_t id, MeshWithIds& mesh) {
  mesh.triangles.metal = true;
  for (const auto& t : object.mesh.triangles) {
    const Vec3 corners[] = {object.mesh.vertices[static_cast<std::size_t>(t[0])], object.mesh.vertices[static_cast<std::size_t>(t[1])],
                            object.mesh.vertices[static_cast<std::size_t>(t[2])]};
    mesh.Add(corners, motion, moving, ObjectColour(), id);
  }
}

bool IsFinite(const Motion& motion) {
  for (const geometry::Rigid3* pose : {&motion.at_open, &motion.at_close, &motion.at_next}) {
    if (!pose->translation.allFinite() || !pose->rotation.coeffs().allFinite()) return false;
  }
  return true;
}

absl::Status Check(const FilmSubject& subject) {
  const std::size_t n = subject.cells->size();
  if (subject.motion.size() != n || subject.state.size() != n || (!subject.scale.empty() && subject.scale.size() != n) ||
      (subject.patch && subject.patch->size() != n) || (subject.colour && subject.colour->size() != n)) {
    return absl::InvalidArgumentError(fmt::format("{} cells have not as many poses, states, patches or colours", n));
  }
  for (std::size_t cell = 0; cell < n; ++cell) {
    if (!IsFinite(subject.motion[cell])) return absl::InvalidArgumentError(fmt::format("the pose of cell {} is not finite", cell));
  }
  for (const auto& [object, motion] : subject.objects) {
    if (!IsFinite(motion)) return absl::InvalidArgumentError(fmt::format("the pose of {} is not finite", object->name));
  }
  return absl::OkStatus();
}

/// The captured points as nanoflann wants them.
struct PointCloud {
  const std::vector<Vec3>& points;
  std::size_t kdtree_get_point_count() const { return points.size(); }
  double kdtree_get_pt(std::size_t i, std::size_t axis) const { return points[i][static_cast<Eigen::Index>(axis)]; }
  template <typename Box>
  bool kdtree_get_bbox(Box&) const {
    return false;
  }
};

}  // namespace

absl::StatusOr<FilmScene> FilmScene::Build(const FilmSubject& subject, bool moving) {
  RETURN_IF_ERROR(Check(subject));
  std::vector<Triangles> meshes;
  std::vector<std::vector<std::int32_t>> ids;
  const auto keep = [&](MeshWithIds& mesh) {
    meshes.push_back(std::move(mesh.triangles));
    ids.push_back(std::move(mesh.ids));
  };
  MeshWithIds cells;
  for (std::size_t cell = 0; cell < subject.cells->size(); ++cell) {
    if (subject.state[cell] != CellState::kGone) AddCell(subject, cell, moving, cells);
  }
  keep(cells);
  for (std::size_t i = 0; i < subject.objects.size(); ++i) {
    MeshWithIds mesh;
    AddObject(*subject.objects[i].first, subject.objects[i].second, moving, kObjectId - static_cast<std::int32_t>(i), mesh);
    keep(mesh);
  }
  ASSIGN_OR_RETURN(Scene scene, Scene::Build({}, meshes));
  return FilmScene(subject, std::move(scene), std::move(ids));
}

const Motion& FilmScene::MotionOf(const Hit& hit) const {
  const std::int32_t id = IdOf(hit);
  return id >= 0 ? subject_->motion[static_cast<std::size_t>(id)] : subject_->objects[static_cast<std::size_t>(kObjectId - id)].second;
}

Vec3f FilmScene::OnePictureLater(const Hit& hit, const Vec3f& point) const {
  const Motion& motion = MotionOf(hit);
  return (motion.at_next * (motion.at_open.Inverse() * point.cast<double>())).cast<float>();
}

std::vector<Vec3f> ColoursFromCapture(const Cells& cells) {
  if (cells.surface.colours.empty() || cells.surface.positions.empty()) return {};
  constexpr std::size_t kNearest = 16;
  const PointCloud cloud{cells.surface.positions};
  using Tree = nanoflann::KDTreeSingleIndexAdaptor<nanoflann::L2_Simple_Adaptor<double, PointCloud>, PointCloud, 3>;
  const Tree tree(3, cloud, nanoflann::KDTreeSingleIndexAdaptorParams(16));
  std::vector<Vec3f> colours;
  for (const Vec3& centroid : cells.centroid) {
    std::array<std::uint32_t, kNearest> index;
    std::array<double, kNearest> squared;
    const std::size_t found = tree.knnSearch(centroid.data(), kNearest, index.data(), squared.data());
    Vec3f sum = Vec3f::Zero();
    for (std::size_t i = 0; i < found; ++i) sum += LinearFromRgb8(cells.surface.colours[index[i]]);
    colours.push_back(sum / static_cast<float>(found));
  }
  return colours;
}

}  // namespace vorocast::rendering
