// SPDX-License-Identifier: AGPL-3.0-or-later
#include "services/rendering/palette.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

namespace vorocast::rendering {
namespace {

using geometry::Vec3f;

/// OKLab (Ottosson 2020) keeps equal steps of lightness and hue equal to the eye.
Vec3f LinearFromOklab(float lightness, float a, float b) {
  const float l = lightness + 0.3963377774F * a + 0.2158037573F * b;
  const float m = lightness - 0.1055613458F * a - 0.0638541728F * b;
  const float s = lightness - 0.0894841775F * a - 1.2914855480F * b;
  const float l3 = l * l * l;
  const float m3 = m * m * m;
  const float s3 = s * s * s;
  return Vec3f(4.0767416621F * l3 - 3.3077115913F * m3 + 0.2309699292F * s3, -1.2684380046F * l3 + 2.6097574011F * m3 - 0.3413193965F * s3,
               -0.0041960863F * l3 - 0.7034186147F * m3 + 1.7076147010F * s3)
      .cwiseMax(0.0F)
      .cwiseMin(1.0F);
}

float LinearFromSrgb(float value) { return value <= 0.04045F ? value / 12.92F : std::pow((value + 0.055F) / 1.055F, 2.4F); }
float SrgbFromLinear(float value) { return value <= 0.0031308F ? 12.92F * value : 1.055F * std::pow(value, 1 / 2.4F) - 0.055F; }

}  // namespace

Vec3f LinearFromRgb8(const geometry::Rgb8& colour) {
  static const std::array<float, 256> linear_of_level = [] {
    std::array<float, 256> table;
    for (std::size_t i = 0; i < 256; ++i) table[i] = LinearFromSrgb(static_cast<float>(i) / 255);
    return table;
  }();
  return {linear_of_level[colour[0]], linear_of_level[colour[1]], linear_of_level[colour[2]]};
}

geometry::Rgb8 Rgb8FromLinear(const Vec3f& colour) {
  geometry::Rgb8 result;
  for (int i = 0; i < 3; ++i) {
    result[static_cast<std::size_t>(i)] = static_cast<std::uint8_t>(std::lround(255 * SrgbFromLinear(std::clamp(colour[i], 0.0F, 1.0F))));
  }
  return result;
}

Vec3f PatchColour(std::int32_t index) {
  static constexpr std::array<float, 3> kLightness = {0.74F, 0.64F, 0.82F};
  const auto i = static_cast<std::uint32_t>(index);
  // The golden ratio spreads any run of hues evenly.
  const double turn = std::fmod(0.07 + 0.61803398875 * i, 1.0);
  const auto hue = static_cast<float>(2 * std::numbers::pi * turn);
  const float chroma = 0.125F;
  return LinearFromOklab(kLightness[i % 3], chroma * std::cos(hue), chroma * std::sin(hue));
}

}  // namespace vorocast::rendering
