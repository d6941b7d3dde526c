// SPDX-License-Identifier: AGPL-3.0-or-later
#include "services/rendering/picture.h"

#include <array>
#include <cstdint>

#include "services/rendering/palette.h"

namespace vorocast::rendering {
namespace {

using geometry::Vec3f;

constexpr LightRays kRays = {.samples = 4, .sky = 4, .key_ground = 4, .key_surface = 1};
/// Rotated grid: its four rows and columns are all different, which smooths near-vertical and near-horizontal edges best.
constexpr std::array<std::array<float, 2>, kRays.samples> kLens = {{{0.125F, 0.625F}, {0.375F, 0.125F}, {0.625F, 0.875F}, {0.875F, 0.375F}}};
constexpr float kFar = 1e4F;

}  // namespace

geometry::Rgb8 Backdrop(std::int32_t row, std::int32_t height) { return Rgb8FromLinear(LinearBackdrop(row, height)); }

Image RenderPicture(const Scene& scene, const Camera& camera, const Studio& studio, const base::Progress& progress) {
  Image image{.width = camera.width, .height = camera.height, .rgb = {}};
  image.rgb.reserve(3 * static_cast<std::size_t>(camera.width) * static_cast<std::size_t>(camera.height));
  const StudioLight light(scene, camera, studio, kRays);
  for (std::int32_t row = 0; row < camera.height; ++row) {
    const Vec3f backdrop = LinearBackdrop(row, camera.height);
    for (std::int32_t column = 0; column < camera.width; ++column) {
      const Jitter jitter(column, row);
      Vec3f sum = Vec3f::Zero();
      for (int sample = 0; sample < kRays.samples; ++sample) {
        const auto& lens = kLens[static_cast<std::size_t>(sample)];
        const Ray ray = camera.Through(static_cast<float>(column) + lens[0], static_cast<float>(row) + lens[1], kFar);
        const Seen seen = light.Look(ray, sample, jitter);
        sum += seen.hit ? seen.colour : Vec3f(backdrop.cwiseProduct(seen.unshadowed));
      }
      const geometry::Rgb8 pixel = Rgb8FromLinear(sum / kRays.samples);
      image.rgb.insert(image.rgb.end(), pixel.begin(), pixel.end());
    }
    base::Report(progress, static_cast<double>(row + 1) / camera.height);
  }
  return image;
}

}  // namespace vorocast::rendering
