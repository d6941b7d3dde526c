// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <vector>

#include "services/simulation/effect_settings.h"
#include "services/simulation/tracked_motion.h"

namespace vorocast::simulation {

/// When each cell is let go (paper, section 6.1, asynchronous deactivation): seconds from the first frame, infinity for never. [n]
std::vector<double> ScheduleRelease(const TrackedMotion& motion, const std::vector<ReleaseByHeight>& rules);

}  // namespace vorocast::simulation
