// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <vector>

#include "services/geometry/tracked_take.h"
#include "services/simulation/tracked_motion.h"

namespace vorocast::simulation {

/// Which cells something acts on, and how strongly: the fields of #/definitions/mask in effects/effect.schema.json. One mechanism for all
/// effects. What a mask looks at never changes, so a weight a cell is all there is to know.
struct MaskSettings {
  struct Ball {
    geometry::Vec3 position_m = geometry::Vec3::Zero();
    double radius_m = 0.2;
    double soft_m = 0;
  };
  std::optional<std::vector<std::int32_t>> components;  // empty: all
  std::optional<std::vector<std::int32_t>> patches;
  std::array<double, 2> height = {0, 1};  // shares of the body's height at the first frame
  double height_soft = 0;
  std::array<double, 2> depth_m = {0, 1000};
  double depth_soft_m = 0;
  std::vector<Ball> painted;  // positions as those of objects with the origin "take"
  bool invert = false;
};

/// What a mask looks at: the template's components, patches and depths, and where the cells are at the first frame.
struct MaskSubject {
  MaskSubject(const geometry::Template& model, const TrackedMotion& motion, const geometry::Vec3& take_origin);
  const geometry::Template& model;
  std::vector<geometry::Vec3> centre;  // [n] from the take's origin, metres
  std::vector<double> height;          // [n] 0 lowest, 1 highest
};

/// The weight of every cell, 0 … 1: the product of what its conditions give. [n]
std::vector<double> MaskWeights(const MaskSettings& mask, const MaskSubject& subject);

}  // namespace vorocast::simulation
