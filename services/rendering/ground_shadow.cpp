// SPDX-License-Identifier: AGPL-3.0-or-later
#include "services/rendering/ground_shadow.h"

#include <algorithm>

namespace vorocast::rendering {
namespace {

using geometry::Vec3f;

constexpr std::int32_t kSquare = 8;  // pixels, the largest
constexpr float kBend = 0.012F;      // a square's middle may differ by this from the mean of its corners: three of 255 steps
constexpr float kSlope = 0.10F;      // and its corners by this from each other
constexpr int kRaysASample = 16;     // of each kind
constexpr float kFar = 1e4F;

std::size_t GridSize(std::int32_t pixels) { return static_cast<std::size_t>((pixels / kSquare + 1) * kSquare + 1); }

}  // namespace

GroundShadow::GroundShadow(const StudioLight& light, const Camera& camera, bool moving, int samples)
    : light_(light),
      camera_(camera),
      moving_(moving),
      rays_(std::clamp(kRaysASample * samples, 64, StudioLight::kGroundRaysMax)),
      width_(static_cast<std::int32_t>(GridSize(camera.width))),
      value_(GridSize(camera.width) * GridSize(camera.height)),
      known_(value_.size()) {}

const Vec3f& GroundShadow::Exact(std::int32_t column, std::int32_t row) {
  const auto at = static_cast<std::size_t>(row) * static_cast<std::size_t>(width_) + static_cast<std::size_t>(column);
  if (known_[at]) return value_[at];
  known_[at] = true;
  const auto on_ground = [&](float x, float y) {
    return light_.OnGround(camera_.Through(static_cast<float>(column) + x, static_cast<float>(row) + y, kFar));
  };
  // Below its middle a pixel is on the ground if its middle is.
  const auto middle = on_ground(0.5F, 0.5F);
  const auto right = on_ground(1.5F, 0.5F);
  const auto below = on_ground(0.5F, 1.5F);
  value_[at] = middle && right && below
                   ? light_.Unshadowed({.middle = *middle, .across = *right - *middle, .along = *below - *middle}, rays_, moving_, at)
                   : Vec3f(Vec3f::Ones());
  return value_[at];
}

Vec3f GroundShadow::At(std::int32_t column, std::int32_t row) {
  std::int32_t left = column / kSquare * kSquare;
  std::int32_t top = row / kSquare * kSquare;
  for (std::int32_t size = kSquare; size > 1; size /= 2) {
    const Vec3f& a = Exact(left, top);
    const Vec3f& b = Exact(left + size, top);
    const Vec3f& c = Exact(left, top + size);
    const Vec3f& d = Exact(left + size, top + size);
    const Vec3f spread = a.cwiseMax(b).cwiseMax(c).cwiseMax(d) - a.cwiseMin(b).cwiseMin(c).cwiseMin(d);
    const float x = static_cast<float>(column - left) / static_cast<float>(size);
    const float y = static_cast<float>(row - top) / static_cast<float>(size);
    const bool smooth =
        spread.maxCoeff() < kSlope && (Exact(left + size / 2, top + size / 2) - 0.25F * (a + b + c + d)).cwiseAbs().maxCoeff() < kBend;
    if (smooth) return (1 - y) * ((1 - x) * a + x * b) + y * ((1 - x) * c + x * d);
    left += column >= left + size / 2 ? size / 2 : 0;
    top += row >= top + size / 2 ? size / 2 : 0;
  }
  return Exact(column, row);
}

}  // namespace vorocast::rendering
