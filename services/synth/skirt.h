// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <array>
#include <deque>
#include <vector>

#include "services/geometry/triangle_mesh.h"
#include "services/synth/skeleton.h"

namespace vorocast::synth {

/// The skirt's fabric: a closed solid 15 mm thick, hung from the waist over the hips, with pleats.
constexpr std::int32_t kSkirtColumns = 144;
constexpr std::int32_t kSkirtKnots = 12;  // heights at which the flare of a column is known

/// What a skirt looks like at an instant: how far each column stands off from the vertical at each height, and how far the hem trails the hips.
struct SkirtShape {
  std::array<std::array<float, kSkirtKnots>, kSkirtColumns> flare_rad{};
  double hem_twist_rad = 0;
};

/// Every column is a damped pendulum hung from the hips: it trails when they accelerate, flies out when they turn, is tied to its neighbours, is
/// pushed out by the legs, and its lower parts follow its upper ones late. Steps of fixed length, so that a shape depends on its time alone.
class SwingingSkirt {
 public:
  /// Hangs still at `seconds`.
  explicit SwingingSkirt(double seconds);
  /// Lets it swing until `seconds`.
  void AdvanceTo(double seconds);
  SkirtShape Shape() const;

 private:
  using Ring = std::array<double, kSkirtColumns>;
  void Step();

  std::int64_t step_ = 0;
  Ring flare_{}, rate_{}, least_{};
  double heading_rad_ = 0, heading_rate_ = 0;  // of the hem
  std::deque<Ring> history_;                   // newest first
};

/// The solid's triangles and colours; positions come from PlaceSkirt.
geometry::TriangleMesh SkirtTopology();
std::vector<geometry::Vec3> PlaceSkirt(const SkirtShape& shape, const Pose& pose);

}  // namespace vorocast::synth
