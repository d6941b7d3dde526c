// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include "services/geometry/simulated_take.h"
#include "services/geometry/tracked_take.h"
#include "services/rendering/camera.h"
#include "services/rendering/film.h"

namespace vorocast::rendering {

/// Everything that is there at one stored instant of a simulated take, moving on to the next one while the shutter is open. `model`, `take` and
/// `colours` (as FilmSubject's, or empty: by patch) outlive the subject; model and take fit each other.
FilmSubject SubjectOf(const geometry::Template& model, const geometry::SimulatedTake& take, const std::vector<geometry::Vec3f>& colours,
                      std::size_t step, double shutter);

/// A tracked take as a simulated one in which nothing is ever let go.
geometry::SimulatedTake AsSimulated(const geometry::TrackedTake& take);

/// What a film's camera has to show: the performer in every frame of the tracked take. What an effect throws about may leave the picture.
/// `azimuth_deg`: from where to look.
Bounds BoundsOf(const geometry::TrackedTake& take, double& azimuth_deg);

}  // namespace vorocast::rendering
