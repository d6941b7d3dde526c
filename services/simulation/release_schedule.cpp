// SPDX-License-Identifier: AGPL-3.0-or-later
#include "services/simulation/release_schedule.h"

#include <algorithm>
#include <limits>

namespace vorocast::simulation {

std::vector<double> ScheduleRelease(const TrackedMotion& motion, const std::vector<ReleaseByHeight>& rules) {
  std::vector<double> release_time(motion.cell_count(), std::numeric_limits<double>::infinity());
  std::vector<geometry::Rigid3> pose;
  for (const ReleaseByHeight& rule : rules) {
    motion.Sample(rule.start_s, pose);
    const auto by_height = [](const geometry::Rigid3& a, const geometry::Rigid3& b) { return a.translation.y() < b.translation.y(); };
    const auto [lowest, highest] = std::ranges::minmax_element(pose, by_height);
    const double bottom = lowest->translation.y();
    const double height = std::max(highest->translation.y() - bottom, 1e-9);
    for (std::size_t c = 0; c < pose.size(); ++c) {
      const double up = (pose[c].translation.y() - bottom) / height;
      const double way = rule.from_top ? 1 - up : up;  // 0 for the first to go, 1 for the last of the whole body
      if (way > rule.share) continue;
      const double order = rule.share > 0 ? way / rule.share : 0;
      release_time[c] = std::min(release_time[c], rule.start_s + order * (rule.end_s - rule.start_s));
    }
  }
  return release_time;
}

}  // namespace vorocast::simulation
