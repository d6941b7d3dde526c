// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <cstdint>
#include <vector>

#include <nlohmann/json_fwd.hpp>

#include "services/base/status.h"
#include "services/rendering/camera.h"

namespace vorocast::rendering {

/// Where a film's camera stands over time; between keys everything goes along straight lines, before the first and after the last it stands still.
struct CameraPath {
  struct Key {
    double time_s = 0;                                // from the take's first frame
    geometry::Vec3 eye = geometry::Vec3(0, 1.5, 4);   // metres
    geometry::Vec3 target = geometry::Vec3(0, 1, 0);  // metres; what is in the middle of the picture
    double fov_deg = 30;                              // vertical field of view
  };
  std::vector<Key> keys;  // ascending in time, at least one
};

/// Reads {"eye_m": [x, y, z], "target_m": [x, y, z], "fov_deg": 30}, or {"keys": [{"time_s": 0, "eye_m": …}, …]}. y is up.
/// INVALID_ARGUMENT names the field and what it may hold.
absl::StatusOr<CameraPath> CameraPathFromJson(const nlohmann::json& json);

/// The camera at an instant.
Camera CameraAt(const CameraPath& path, double seconds, std::int32_t width, std::int32_t height);

/// A camera that shows all of the bounds with a margin in a picture of this size, three-quarters from the front.
Camera CameraForFilm(const Bounds& bounds, double azimuth_deg, std::int32_t width, std::int32_t height);

}  // namespace vorocast::rendering
