// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <cstdint>
#include <vector>

#include "services/rendering/film.h"
#include "services/rendering/scene.h"

namespace vorocast::rendering {

/// A film subject as rays meet it, and what a hit is of. The subject must outlive it.
class FilmScene {
 public:
  /// As the shutter opens and as it closes. INVALID_ARGUMENT for arrays of different lengths or poses that are not finite.
  static absl::StatusOr<FilmScene> Build(const FilmSubject& subject);

  const Scene& rays() const { return scene_; }
  /// The cell, or kObjectId − number of the scene object.
  std::int32_t IdOf(const Hit& hit) const { return PieceOf(hit).id; }
  std::int32_t PatchOf(std::int32_t cell) const { return subject_->patch ? (*subject_->patch)[static_cast<std::size_t>(cell)] : -1; }
  /// Where a point of what was hit, which is at `point` now, is one picture later.
  geometry::Vec3f OnePictureLater(const Hit& hit, const geometry::Vec3f& point) const;

 private:
  /// One rigid thing among the subject's.
  struct Piece {
    std::int32_t id;
    const Motion* motion;
  };
  /// Triangles of one material, and the piece that each belongs to.
  struct PieceMesh;

  FilmScene(const FilmSubject& subject, Scene scene, std::vector<Piece> pieces, std::vector<std::vector<std::uint32_t>> piece_of)
      : subject_(&subject), scene_(std::move(scene)), pieces_(std::move(pieces)), piece_of_(std::move(piece_of)) {}
  const Piece& PieceOf(const Hit& hit) const { return pieces_[piece_of_[hit.mesh][hit.triangle]]; }

  const FilmSubject* subject_;
  Scene scene_;
  std::vector<Piece> pieces_;
  std::vector<std::vector<std::uint32_t>> piece_of_;  // of each mesh, by triangle
};

}  // namespace vorocast::rendering
