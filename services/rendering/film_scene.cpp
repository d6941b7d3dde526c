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

/// Copies stand back behind the performer.
Vec3f CopyColour(const Vec3f& colour) { return 0.55F * colour + Vec3f::Constant(0.45F); }

Vec3f SkinColour(const FilmSubject& subject, std::int32_t cell) {
  if (subject.colour) return (*subject.colour)[static_cast<std::size_t>(cell)];
  return PatchColour(subject.patch ? (*subject.patch)[static_cast<std::size_t>(cell)] : cell);
}

bool IsFinite(const Motion& motion) {
  for (const geometry::Rigid3* pose : {&motion.at_open, &motion.at_close, &motion.at_next}) {
    if (!pose->translation.allFinite() || !pose->rotation.coeffs().allFinite()) return false;
  }
  return true;
}

/// Whether it moves at all while the shutter is open.
bool Moves(const Motion& motion) {
  return motion.at_open.translation != motion.at_close.translation || motion.at_open.rotation.coeffs() != motion.at_close.rotation.coeffs();
}
bool Moves(const FilmSubject& subject) {
  return std::ranges::any_of(subject.motion, [](const Motion& motion) { return Moves(motion); }) ||
         std::ranges::any_of(subject.copies, [](const FilmCopy& copy) { return Moves(copy.motion); }) ||
         std::ranges::any_of(subject.shapes, [](const FilmShape& shape) { return Moves(shape.motion); });
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
  const auto is_cell = [n](std::int32_t cell) { return cell >= 0 && static_cast<std::size_t>(cell) < n; };
  for (const FilmCopy& copy : subject.copies) {
    if (!is_cell(copy.cell) || !IsFinite(copy.motion))
      return absl::InvalidArgumentError(fmt::format("a copy of cell {} of {}, or its pose, is wrong", copy.cell, n));
  }
  for (const FilmShape& shape : subject.shapes) {
    if (!is_cell(shape.cell) || !IsFinite(shape.motion))
      return absl::InvalidArgumentError(fmt::format("a shape of cell {} of {}, or its pose, is wrong", shape.cell, n));
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

struct FilmScene::PieceMesh {
  bool moving = false;
  Triangles triangles;
  std::vector<std::uint32_t> piece_of;

  void Add(std::span<const Vec3> corners, const Motion& motion, const Vec3f& colour, std::uint32_t piece) {
    for (const auto& triangle : geometry::Triangulate(corners)) {
      for (const std::int32_t i : triangle) {
        const Vec3& corner = corners[static_cast<std::size_t>(i)];
        triangles.corners.push_back((motion.at_open * corner).cast<float>());
        if (moving) triangles.corners_at_close.push_back((motion.at_close * corner).cast<float>());
      }
      triangles.colours.push_back(colour);
      piece_of.push_back(piece);
    }
  }

  void AddCell(const Cells& cells, std::int32_t number, double scale, const Motion& motion, const Vec3f& skin, std::uint32_t piece) {
    const auto cell = static_cast<std::size_t>(number);
    const Vec3 centroid = cells.centroid[cell];
    std::vector<Vec3> corners;
    for (std::int64_t f = cells.face_offset[cell]; f < cells.face_offset[cell + 1]; ++f) {
      const auto face = static_cast<std::size_t>(f);
      corners.clear();
      for (std::int64_t i = cells.vertex_offset[face]; i < cells.vertex_offset[face + 1]; ++i) {
        const Vec3& vertex = cells.vertices[static_cast<std::size_t>(cells.vertex[static_cast<std::size_t>(i)])];
        corners.push_back(centroid + kShrink * scale * (vertex - centroid));
      }
      Add(corners, motion, cells.neighbour[face] < 0 ? skin : CutColour(skin), piece);
    }
  }

  void AddMesh(const geometry::TriangleMesh& mesh, const Motion& motion, const Vec3f& colour, std::uint32_t piece) {
    for (const auto& t : mesh.triangles) {
      const Vec3 corners[] = {mesh.vertices[static_cast<std::size_t>(t[0])], mesh.vertices[static_cast<std::size_t>(t[1])],
                              mesh.vertices[static_cast<std::size_t>(t[2])]};
      Add(corners, motion, colour, piece);
    }
  }
};

absl::StatusOr<FilmScene> FilmScene::Build(const FilmSubject& subject) {
  RETURN_IF_ERROR(Check(subject));
  std::vector<Piece> pieces;
  const auto piece = [&](std::int32_t id, const Motion& motion) {
    pieces.push_back({id, &motion});
    return static_cast<std::uint32_t>(pieces.size() - 1);
  };
  // What stands still is traced twice as fast.
  PieceMesh body{.moving = Moves(subject)};
  PieceMesh objects{.moving = std::ranges::any_of(subject.objects, [](const auto& object) { return Moves(object.second); })};
  objects.triangles.metal = true;
  for (std::size_t c = 0; c < subject.cells->size(); ++c) {
    if (subject.state[c] == CellState::kGone) continue;
    const auto cell = static_cast<std::int32_t>(c);
    body.AddCell(*subject.cells, cell, subject.scale.empty() ? 1 : subject.scale[c], subject.motion[c], SkinColour(subject, cell),
                 piece(cell, subject.motion[c]));
  }
  for (const FilmCopy& copy : subject.copies) {
    body.AddCell(*subject.cells, copy.cell, copy.scale, copy.motion, CopyColour(SkinColour(subject, copy.cell)), piece(copy.cell, copy.motion));
  }
  for (const FilmShape& shape : subject.shapes)
    body.AddMesh(shape.mesh, shape.motion, SkinColour(subject, shape.cell), piece(shape.cell, shape.motion));
  for (std::size_t i = 0; i < subject.objects.size(); ++i) {
    const auto& [object, motion] = subject.objects[i];
    objects.AddMesh(object->mesh, motion, ObjectColour(), piece(kObjectId - static_cast<std::int32_t>(i), motion));
  }
  std::vector<std::vector<std::uint32_t>> piece_of = {std::move(body.piece_of), std::move(objects.piece_of)};
  std::vector<Triangles> meshes;
  meshes.push_back(std::move(body.triangles));
  meshes.push_back(std::move(objects.triangles));
  ASSIGN_OR_RETURN(Scene scene, Scene::Build({}, meshes));
  return FilmScene(subject, std::move(scene), std::move(pieces), std::move(piece_of));
}

Vec3f FilmScene::OnePictureLater(const Hit& hit, const Vec3f& point) const {
  const Motion& motion = *PieceOf(hit).motion;
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
