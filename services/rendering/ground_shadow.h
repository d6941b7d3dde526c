// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <vector>

#include "services/rendering/studio.h"

namespace vorocast::rendering {

/// The subject's shadow on the ground as a camera sees it, a value a pixel. Shadows are smooth nearly everywhere: they are worked out with many rays
/// at the corners and in the middle of squares of pixels, and in between only where those do not agree. So a picture's shadows take fewer rays
/// than one would need to send from every pixel, and have no grain.
class GroundShadow {
 public:
  /// All arguments outlive this. `moving`: over the shutter's time. `samples`: camera rays a pixel; more of them ask for better shadows too.
  GroundShadow(const StudioLight& light, const Camera& camera, bool moving, int samples);

  /// Of a pixel's middle; one above the horizon. Remembers what it works out, and says the same whatever was asked before.
  geometry::Vec3f At(std::int32_t column, std::int32_t row);

 private:
  const geometry::Vec3f& Exact(std::int32_t column, std::int32_t row);

  const StudioLight& light_;
  const Camera& camera_;
  bool moving_;
  int rays_;
  std::int32_t width_;  // of the grid: a square beyond the picture's edge needs its corners too
  std::vector<geometry::Vec3f> value_;
  std::vector<bool> known_;
};

}  // namespace vorocast::rendering
