// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <vector>

#include "services/base/status.h"
#include "services/geometry/simulated_take.h"
#include "services/simulation/key_framed.h"
#include "services/simulation/mask.h"

namespace vorocast::simulation {

/// Time persistence (paper, section 6.2): at intervals the performer leaves a copy behind, which goes on in slower time, wears away and
/// vanishes. A copy is made of what was simulated, so it shows whatever else the effect does; nothing collides with it.
struct PersistenceSettings {
  double start_s = 0;
  double end_s = 3600;
  double interval_s = 0.5;
  double lifetime_s = 2;
  Scalar speed = Scalar({{0, 1}, {1, 0}});                    // of a copy's own time, by its age
  Vector drift_m_s = geometry::Vec3(geometry::Vec3::Zero());  // by its age
  enum class From : std::uint8_t { kOutside, kInside, kTop, kBottom };
  From erode_from = From::kOutside;
  double erode_start_s = 0.5;  // age at which the first cell goes; the last goes at lifetime_s
  double vanish_s = 0.2;
  MaskSettings mask;
};

/// Fills result.copies from its stored cells. INVALID_ARGUMENT when there would be too many to store.
absl::Status AddCopies(const std::vector<PersistenceSettings>& settings, const MaskSubject& subject, geometry::SimulatedTake& result);

}  // namespace vorocast::simulation
