// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <cstdint>
#include <vector>

#include "services/rendering/film.h"
#include "services/rendering/scene.h"

namespace vorocast::rendering {

/// A film subject as rays meet it, and what a hit is of.
class FilmScene {
 public:
  /// `moving`: with the shutter's two ends; else as it opens. INVALID_ARGUMENT for arrays of different lengths or poses that are not finite.
  static absl::StatusOr<FilmScene> Build(const FilmSubject& subject, bool moving);

  const Scene& rays() const { return scene_; }
  /// The cell, or kObjectId − number of the scene object.
  std::int32_t IdOf(const Hit& hit) const { return ids_[hit.mesh][hit.triangle]; }
  std::int32_t PatchOf(std::int32_t cell) const { return subject_->patch ? (*subject_->patch)[static_cast<std::size_t>(cell)] : -1; }
  /// Where a point of what was hit, which is at `point` now, is one picture later.
  geometry::Vec3f OnePictureLater(const Hit& hit, const geometry::Vec3f& point) const;

 private:
  FilmScene(const FilmSubject& subject, Scene scene, std::vector<std::vector<std::int32_t>> ids)
      : subject_(&subject), scene_(std::move(scene)), ids_(std::move(ids)) {}
  const Motion& MotionOf(const Hit& hit) const;

  const FilmSubject* subject_;
  Scene scene_;
  std::vector<std::vector<std::int32_t>> ids_;  // of each mesh, by triangle
};

}  // namespace vorocast::rendering
