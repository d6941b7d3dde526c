// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include "services/base/progress.h"
#include "services/rendering/camera.h"
#include "services/rendering/scene.h"
#include "services/rendering/sheet.h"
#include "services/rendering/studio.h"

namespace vorocast::rendering {

/// The backdrop of a row: what a pixel shows where nothing stands and no shadow falls.
geometry::Rgb8 Backdrop(std::int32_t row, std::int32_t height);

/// Ray-traces one picture for people to look at. Deterministic: noise comes from a hash of the pixel.
Image RenderPicture(const Scene& scene, const Camera& camera, const Studio& studio, const base::Progress& progress);

}  // namespace vorocast::rendering
