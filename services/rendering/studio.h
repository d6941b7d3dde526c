// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <optional>

#include "services/rendering/camera.h"
#include "services/rendering/scene.h"

namespace vorocast::rendering {

/// The studio: a key light from the upper left of the camera, a bright sky all around, a ground that only its shadows show.
struct Studio {
  float ground = 0;  // height of the ground plane, metres
  float extent = 2;  // of the subject, metres: sets how far ambient shadows reach
};

/// Rays that one camera ray sends on. A pixel's rays should come to about sixteen of each kind.
struct LightRays {
  int samples = 4;      // camera rays a pixel
  int sky = 4;          // for each of them
  int key_ground = 4;   // a large shadow on the bare ground shows grain that a coloured surface hides, and rays from there mostly meet nothing
  int key_surface = 1;  // which costs little
};

/// Two numbers in [0, 1) for a pixel. Interleaved gradient noise (Jimenez 2014): neighbours differ so evenly that what is left of it looks
/// like fine grain and not like dirt.
struct Jitter {
  float u, v;
  Jitter(std::int32_t column, std::int32_t row);
};

/// What a camera ray sees.
struct Seen {
  std::optional<Hit> hit;                                // none: the ground, or nothing
  geometry::Vec3f colour = geometry::Vec3f::Zero();      // of the hit, lit; linear, below 1
  geometry::Vec3f unshadowed = geometry::Vec3f::Ones();  // without a hit: how much of the light the subject leaves the ground here, 0 … 1
};

/// Lights what camera rays meet. Deterministic: noise comes from the pixel.
class StudioLight {
 public:
  /// The scene and the studio must outlive it. The key light stands relative to the camera.
  StudioLight(const Scene& scene, const Camera& camera, const Studio& studio, const LightRays& rays);

  /// True only where no ray within `spread` (at distance 1) of this one meets anything, not even a shadow on the ground.
  bool SeesNothing(const Ray& ray, float spread) const;
  /// `sample`: 0 … samples−1, which of the pixel's rays it is.
  Seen Look(const Ray& ray, int sample, const Jitter& jitter) const;

 private:
  geometry::Vec3f Surface(const Ray& ray, const Hit& hit, int sample, const Jitter& jitter) const;
  bool IsFarFromAll(const geometry::Vec3f& from, float margin) const;
  bool MeetsBox(const geometry::Vec3f& from, const geometry::Vec3f& direction, float margin) const;
  geometry::Vec3f Unshadowed(const Ray& ray, const geometry::Vec3f& point, int sample, const Jitter& jitter) const;
  float Key(const Ray& ray, const geometry::Vec3f& from, const geometry::Vec3f& normal, int rays, int sample, const Jitter& jitter) const;
  geometry::Vec3f Sky(const Ray& ray, const geometry::Vec3f& from, const geometry::Vec3f& normal, int sample, const Jitter& jitter) const;

  const Scene& scene_;
  const Studio& studio_;
  LightRays rays_;
  geometry::Vec3f key_;  // unit, towards the light
};

/// The backdrop of a row, linear: what a pixel shows where nothing stands and no shadow falls.
geometry::Vec3f LinearBackdrop(std::int32_t row, std::int32_t height);

}  // namespace vorocast::rendering
