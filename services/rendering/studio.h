// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>

#include "services/rendering/camera.h"
#include "services/rendering/scene.h"

namespace vorocast::rendering {

/// The studio: a key light from the upper left of the camera, a bright sky all around, a ground that only its shadows show.
struct Studio {
  float ground = 0;  // height of the ground plane, metres
  float extent = 2;  // of the subject, metres: sets how far ambient shadows reach
};

/// Rays that one camera ray sends on from a surface. A pixel's rays should come to about sixteen towards the sky.
struct LightRays {
  int samples = 4;  // camera rays a pixel
  int sky = 4;      // for each of them, at most kSkyMax
  int key = 1;      // at most kKeyMax; this costs little, for the light is small
  static constexpr int kSkyMax = 4;
  static constexpr int kKeyMax = 4;
};

/// Two numbers in [0, 1) for a pixel. Interleaved gradient noise (Jimenez 2014): neighbours differ so evenly that what is left of it looks
/// like fine grain and not like dirt.
struct Jitter {
  float u, v;
  Jitter(std::int32_t column, std::int32_t row);
};

/// A surface that a camera ray has met, and the light that comes from there.
struct Lit {
  Ray ray;
  Hit hit;
  int sample = 0;                                    // which of the pixel's rays it is
  geometry::Vec3f colour = geometry::Vec3f::Zero();  // linear, below 1
};

/// A small parallelogram of the ground: what a pixel shows of it.
struct GroundPatch {
  geometry::Vec3f middle;
  geometry::Vec3f across;  // its edges
  geometry::Vec3f along;
};

/// Lights what camera rays meet. Deterministic: noise comes from the pixel.
class StudioLight {
 public:
  /// The scene and the studio must outlive it. The key light stands relative to the camera.
  StudioLight(const Scene& scene, const Camera& camera, const Studio& studio, const LightRays& rays);

  /// True only where no ray within `spread` (at distance 1) of this one meets anything, not even a shadow on the ground.
  bool SeesNothing(const Ray& ray, float spread) const;
  /// What rays meet before the ground: `hits[i]` is ray i's. None: the ground, or nothing.
  void Look(std::span<const Ray> rays, std::span<std::optional<Hit>> hits) const;
  /// Sets the colours of hits of one pixel, at most kShadeMax of them.
  void Shade(std::span<Lit> hits, const Jitter& jitter) const;
  static constexpr std::size_t kShadeMax = 16;
  /// Where a ray meets the ground, as if nothing stood on it; none above the horizon.
  std::optional<geometry::Vec3f> OnGround(const Ray& ray) const;
  /// How much of the light the subject leaves a patch of the ground, 0 … 1, in the mean over the shutter's time where `moving`. Exactly one where
  /// nothing is in the way. `rays` of each kind at most, up to kGroundRaysMax; `seed` decides where they go.
  geometry::Vec3f Unshadowed(const GroundPatch& patch, int rays, bool moving, std::uint64_t seed) const;
  static constexpr int kGroundRaysMax = 256;

 private:
  /// A hit while its light is looked for.
  struct Open;
  void SendOn(const Lit& lit, const Jitter& jitter, Open& open, std::span<Ray> sent) const;
  geometry::Vec3f Gather(const Lit& lit, const Open& open, std::span<const Ray> sent, std::span<const std::uint8_t> blocked) const;
  geometry::Vec3f KeyDirection(const std::array<float, 2>& disc) const;
  bool IsFarFromAll(const geometry::Vec3f& from, float margin) const;
  bool MeetsBox(const geometry::Vec3f& from, const geometry::Vec3f& direction, float margin) const;

  const Scene& scene_;
  const Studio& studio_;
  LightRays rays_;
  geometry::Vec3f key_;            // unit, towards the light
  geometry::Vec3f key_x_, key_y_;  // across it
};

/// The backdrop of a row, linear: what a pixel shows where nothing stands and no shadow falls.
geometry::Vec3f LinearBackdrop(std::int32_t row, std::int32_t height);

}  // namespace vorocast::rendering
