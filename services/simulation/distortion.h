// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <variant>
#include <vector>

#include "services/geometry/rigid3.h"
#include "services/simulation/key_framed.h"
#include "services/simulation/mask.h"

namespace vorocast::simulation {

/// Volumetric distortion: the poses that cells are recalled to are bent through space. Cells stay rigid; heights count from the ground.
struct TwistSettings {
  Scalar angle_deg = 180;  // of what is at to_m against what is at from_m
  double from_m = 0;
  double to_m = 1.8;
};
struct SwellSettings {
  Scalar horizontal = 1;
  Scalar vertical = 1;
};
struct WaveSettings {
  Vector amplitude_m = geometry::Vec3(0.1, 0, 0);
  geometry::Vec3 along = geometry::Vec3::UnitY();
  double length_m = 0.8;
  Scalar frequency_hz = 1;
};
struct DistortionSettings {
  MaskSettings mask;
  std::variant<TwistSettings, SwellSettings, WaveSettings> kind;
};

class Distortion {
 public:
  Distortion(const std::vector<DistortionSettings>& settings, const MaskSubject& subject, const geometry::Vec3& take_origin);
  bool empty() const { return settings_.empty(); }
  /// Distorts the poses of all cells at a time, one setting after the other. The axis of twist and swell stands in the cells' middle.
  void Apply(double time, std::vector<geometry::Rigid3>& world_from_cell) const;

 private:
  const std::vector<DistortionSettings>& settings_;
  const geometry::Vec3 take_origin_;
  std::vector<std::vector<double>> weight_;  // [settings][n]
};

}  // namespace vorocast::simulation
