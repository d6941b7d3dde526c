// SPDX-License-Identifier: AGPL-3.0-or-later
#include "services/rendering/picture.h"

#include <array>
#include <cstdint>

#include "services/rendering/ground_shadow.h"
#include "services/rendering/palette.h"

namespace vorocast::rendering {
namespace {

using geometry::Vec3f;

constexpr LightRays kRays = {.samples = 4, .sky = 4, .key = 1};
/// Rotated grid: its four rows and columns are all different, which smooths near-vertical and near-horizontal edges best.
constexpr std::array<std::array<float, 2>, kRays.samples> kLens = {{{0.125F, 0.625F}, {0.375F, 0.125F}, {0.625F, 0.875F}, {0.875F, 0.375F}}};
constexpr float kFar = 1e4F;

}  // namespace

geometry::Rgb8 Backdrop(std::int32_t row, std::int32_t height) { return Rgb8FromLinear(LinearBackdrop(row, height)); }

Image RenderPicture(const Scene& scene, const Camera& camera, const Studio& studio, const base::Progress& progress) {
  Image image{.width = camera.width, .height = camera.height, .rgb = {}};
  image.rgb.reserve(3 * static_cast<std::size_t>(camera.width) * static_cast<std::size_t>(camera.height));
  const StudioLight light(scene, camera, studio, kRays);
  GroundShadow shadow(light, camera, false, kRays.samples);
  for (std::int32_t row = 0; row < camera.height; ++row) {
    const Vec3f backdrop = LinearBackdrop(row, camera.height);
    for (std::int32_t column = 0; column < camera.width; ++column) {
      const Jitter jitter(column, row);
      std::array<Ray, kRays.samples> rays;
      for (std::size_t i = 0; i < rays.size(); ++i) {
        rays[i] = camera.Through(static_cast<float>(column) + kLens[i][0], static_cast<float>(row) + kLens[i][1], kFar);
      }
      std::array<std::optional<Hit>, kRays.samples> hits;
      light.Look(rays, hits);
      std::array<Lit, kRays.samples> lit;
      std::size_t count = 0;
      for (std::size_t i = 0; i < rays.size(); ++i) {
        if (hits[i]) lit[count++] = {.ray = rays[i], .hit = *hits[i], .sample = static_cast<int>(i)};
      }
      light.Shade(std::span(lit).first(count), jitter);
      const Vec3f ground = count < rays.size() ? Vec3f(backdrop.cwiseProduct(shadow.At(column, row))) : backdrop;
      Vec3f sum = static_cast<float>(rays.size() - count) * ground;
      for (const Lit& one : std::span(lit).first(count)) sum += one.colour;
      const geometry::Rgb8 pixel = Rgb8FromLinear(sum / kRays.samples);
      image.rgb.insert(image.rgb.end(), pixel.begin(), pixel.end());
    }
    base::Report(progress, static_cast<double>(row + 1) / camera.height);
  }
  return image;
}

}  // namespace vorocast::rendering
