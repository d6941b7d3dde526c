// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include "services/base/progress.h"
#include "services/rendering/camera.h"
#include "services/rendering/scene.h"
#include "services/rendering/sheet.h"

namespace vorocast::rendering {

/// The studio: a key light from the upper left of the camera, a bright sky all around, a ground that only its shadows show.
struct Studio {
  float ground = 0;  // height of the ground plane, metres
  float extent = 2;  // of the subject, metres: sets how far ambient shadows reach
};

/// The backdrop of a row: what a pixel shows where nothing stands and no shadow falls.
geometry::Rgb8 Backdrop(std::int32_t row, std::int32_t height);

/// Ray-traces one picture. Deterministic: noise comes from a hash of the pixel.
Image RenderPicture(const Scene& scene, const Camera& camera, const Studio& studio, const base::Progress& progress);

}  // namespace vorocast::rendering
