// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <variant>
#include <vector>

#include "services/simulation/key_framed.h"
#include "services/simulation/mask.h"

namespace vorocast::simulation {

/// What fills space and moves cells (the paper's abstract: gravity pull). Positions count as those of objects do.
struct AttractorSettings {
  Vector position_m = geometry::Vec3(0, 1, 0);
  bool origin_is_take = true;
  Scalar strength_m_s2 = 20;
  double reach_m = 0;  // 0: everywhere alike
  Scalar drag_s = 0.5;
};
struct WindSettings {
  Vector velocity_m_s = geometry::Vec3(4, 0, 0);
  Scalar drag_s = 2;
  Scalar turbulence = 0.3;
  double turbulence_size_m = 0.5;
};
struct FieldSettings {
  bool acts_on_recalled = true;
  MaskSettings mask;
  std::variant<AttractorSettings, WindSettings> kind;
};

/// What a field does to a cell: dv/dt = acceleration + drag (flow − v), here with acceleration + drag · flow as one vector.
struct FieldPush {
  geometry::Vec3 acceleration = geometry::Vec3::Zero();  // at rest, m/s²
  double drag = 0;                                       // 1/s
  /// The velocity after dt: the drag is implicit, so no drag is too strong for the step.
  geometry::Vec3 After(const geometry::Vec3& velocity, double dt) const { return (velocity + dt * acceleration) / (1 + dt * drag); }
};

/// All fields of an effect on the cells of one take.
class ForceFields {
 public:
  ForceFields(const std::vector<FieldSettings>& settings, const MaskSubject& subject, const geometry::Vec3& take_origin);

  bool empty() const { return settings_.empty(); }
  /// Fixes the key frames for a time.
  void Advance(double time);
  /// On cell c, which is at `position`.
  FieldPush At(std::size_t c, const geometry::Vec3& position, bool recalled) const;

 private:
  struct Now {  // a field at the time that was last set
    geometry::Vec3 vector = geometry::Vec3::Zero();
    double strength = 0;
    double drag = 0;
    double turbulence = 0;
    geometry::Vec3 carried = geometry::Vec3::Zero();  // how far the wind has come
  };
  const std::vector<FieldSettings>& settings_;
  const geometry::Vec3 take_origin_;
  std::vector<std::vector<double>> weight_;  // [fields][n]
  std::vector<Now> now_;
};

/// Divergence-free and of unit mean square: a sum of waves of about one length whose directions are fixed, so that the same place and time always
/// give the same flow.
geometry::Vec3 Turbulence(const geometry::Vec3& position_by_size, double time_by_turnover);

}  // namespace vorocast::simulation
