// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <vector>

#include "services/simulation/effect_settings.h"
#include "services/simulation/tracked_motion.h"

namespace vorocast::simulation {

/// When each cell goes (paper, section 6.1, asynchronous deactivation): seconds from the first frame, infinity for never. [n]
struct ReleaseSchedule {
  std::vector<double> release;
  std::vector<double> vanish;    // when it begins to shrink
  std::vector<double> vanish_s;  // how long that takes
};

/// `duration_s`: what comes later is not looked for.
ReleaseSchedule ScheduleRelease(const TrackedMotion& motion, const MaskSubject& subject, const std::vector<ReleaseRule>& rules, double duration_s);

}  // namespace vorocast::simulation
