// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <cstdint>
#include <vector>

#include "services/base/status.h"
#include "services/geometry/vector.h"
#include "services/rendering/scene.h"

namespace vorocast::rendering {

/// A pinhole with a shifted film: the window at distance 1 in front of the eye need not be centred, so that a figure fills its picture
/// without leaning.
struct Camera {
  geometry::Vec3f eye = geometry::Vec3f::Zero();
  geometry::Vec3f right = geometry::Vec3f::UnitX();
  geometry::Vec3f up = geometry::Vec3f::UnitY();
  geometry::Vec3f forward = -geometry::Vec3f::UnitZ();
  float left = -0.5F;  // of the window at distance 1
  float top = 0.5F;
  float pixel = 0.01F;  // side of a pixel at distance 1
  std::int32_t width = 100;
  std::int32_t height = 100;

  /// Through a point of the image, in pixels from its top left corner; unit direction.
  Ray Through(float x, float y, float reach) const {
    const geometry::Vec3f direction = forward + (left + x * pixel) * right + (top - y * pixel) * up;
    return {.origin = eye, .direction = direction.normalized(), .reach = reach};
  }
};

struct Framing {
  double azimuth_deg = 25;    // 0 looks along −z, 90 along −x
  double elevation_deg = 10;  // above the horizon
  std::int32_t width = 480;   // pixels
};

/// What a camera has to show: spheres, as centres and radii, metres.
struct Bounds {
  std::vector<geometry::Vec3f> centres;
  std::vector<float> radii;
  std::vector<geometry::Vec3f> companions;  // corners of scene objects: shown too, where they are not far away
  std::vector<geometry::Vec3f> debris;      // what was let go: shown too, where it is near; all there is to show, when there is nothing else
  std::vector<float> debris_radii;
  /// Lowest point, of the debris too: where the ground is.
  float ground = 0;
  /// Largest side of the box around it.
  float extent = 0;
};

/// The azimuth from which the subject of all pictures is seen three-quarters from the front, in steps of 15°: across its widest horizontal
/// direction, from the side its feet point to. A heuristic for people; anything else is shown from some good side. One Bounds a picture.
double ChooseAzimuth(const std::vector<Bounds>& pictures);

/// Drops the outermost thousandth of spheres on every side (strays and what has flown off must not shrink everything else) and
/// companions and debris further off than a part of the extent, and sets the ground and the extent. INVALID_ARGUMENT for no spheres or values that
/// are not finite.
absl::Status Settle(Bounds& bounds);

/// A camera of the framing's direction that shows all spheres with a margin; its height follows from them, 0.5 to 1.6 times its width.
Camera FrameBounds(const Bounds& bounds, const Framing& framing);

}  // namespace vorocast::rendering
