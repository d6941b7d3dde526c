// SPDX-License-Identifier: AGPL-3.0-or-later
#include "services/simulation/release_schedule.h"

#include <algorithm>
#include <limits>

#include "services/simulation/cell_graph.h"
#include "services/simulation/heat.h"

namespace vorocast::simulation {
namespace {

constexpr double kNever = std::numeric_limits<double>::infinity();

/// Times at which one rule lets each cell go, whatever its mask says. [n]
class Times {
 public:
  Times(const TrackedMotion& motion, const MaskSubject& subject, double duration_s) : motion_(motion), subject_(subject), duration_s_(duration_s) {}

  std::vector<double> operator()(const ReleaseByHeight& rule) const {
    std::vector<double> times(motion_.cell_count(), kNever);
    std::vector<geometry::Rigid3> pose;
    motion_.Sample(rule.start_s, pose);
    const auto by_height = [](const geometry::Rigid3& a, const geometry::Rigid3& b) { return a.translation.y() < b.translation.y(); };
    const auto [lowest, highest] = std::ranges::minmax_element(pose, by_height);
    const double bottom = lowest->translation.y();
    const double height = std::max(highest->translation.y() - bottom, 1e-9);
    for (std::size_t c = 0; c < pose.size(); ++c) {
      const double up = (pose[c].translation.y() - bottom) / height;
      const double way = rule.from_top ? 1 - up : up;  // 0 for the first to go, 1 for the last of the whole body
      if (way > rule.share) continue;
      const double order = rule.share > 0 ? way / rule.share : 0;
      times[c] = rule.start_s + order * (rule.end_s - rule.start_s);
    }
    return times;
  }

  /// Erosion (section 6.1.3): after a delay proportional to the centroid's distance from the template's surface.
  std::vector<double> operator()(const ReleaseByDepth& rule) const {
    const std::vector<double>& depth = subject_.model.cells.depth;
    const double deepest = *std::ranges::max_element(depth);
    std::vector<double> times;
    for (const double d : depth) times.push_back(TimeOfDepth(rule, rule.from_outside ? d : deepest - d));
    return times;
  }

  /// Heat diffusion (section 6.1.2).
  std::vector<double> operator()(const ReleaseByHeat& rule) const {
    const geometry::Cells& cells = subject_.model.cells;
    const HeatGraph graph(CellEdges(cells), cells.volume, rule.geometric ? HeatGraph::Weights::kGeometric : HeatGraph::Weights::kGraph);
    std::vector<double> heat = MaskWeights(rule.source, subject_);
    std::vector<bool> held;
    if (rule.held) {
      // Held cells are of one temperature, so a soft edge of the source is not held.
      for (double& h : heat) {
        held.push_back(h >= 0.5);
        h = held.back() ? 1 : 0;
      }
    }
    std::vector<double> times(heat.size(), kNever);
    for (std::size_t c = 0; c < heat.size(); ++c) {
      if (heat[c] >= rule.threshold) times[c] = rule.start_s;
    }
    constexpr double kSample = 1.0 / 60;
    for (double since = 0; rule.start_s + since < duration_s_;) {
      const double next = since + kSample;
      const double tau = rule.rate_s.Integral(next) - rule.rate_s.Integral(since);
      const std::vector<double> hotter = graph.Diffuse(heat, tau, held);
      for (std::size_t c = 0; c < heat.size(); ++c) {
        if (times[c] != kNever || hotter[c] < rule.threshold) continue;
        const double share = (rule.threshold - heat[c]) / (hotter[c] - heat[c]);
        times[c] = rule.start_s + since + share * kSample;
      }
      heat = hotter;
      since = next;
    }
    return times;
  }

 private:
  /// Bisection in the integral of the speed, which only grows.
  double TimeOfDepth(const ReleaseByDepth& rule, double depth) const {
    if (depth <= 0) return rule.start_s;
    double early = 0;
    double late = std::max(duration_s_ - rule.start_s, 0.0) + 1;
    if (rule.speed_m_s.Integral(late) < depth) return kNever;
    for (int i = 0; i < 60; ++i) {
      const double middle = 0.5 * (early + late);
      (rule.speed_m_s.Integral(middle) < depth ? early : late) = middle;
    }
    return rule.start_s + late;
  }

  const TrackedMotion& motion_;
  const MaskSubject& subject_;
  const double duration_s_;
};

}  // namespace

ReleaseSchedule ScheduleRelease(const TrackedMotion& motion, const MaskSubject& subject, const std::vector<ReleaseRule>& rules, double duration_s) {
  const std::size_t n = motion.cell_count();
  ReleaseSchedule schedule{.release = std::vector(n, kNever), .vanish = std::vector(n, kNever), .vanish_s = std::vector(n, 0.0)};
  for (const ReleaseRule& rule : rules) {
    const std::vector<double> times = std::visit(Times(motion, subject, duration_s), rule.by);
    const std::vector<double> weight = MaskWeights(rule.mask, subject);
    for (std::size_t c = 0; c < n; ++c) {
      if (weight[c] < 0.5) continue;
      if (!rule.vanish) schedule.release[c] = std::min(schedule.release[c], times[c]);
      if (!rule.vanish || times[c] >= schedule.vanish[c]) continue;
      schedule.vanish[c] = times[c];
      schedule.vanish_s[c] = rule.vanish_s;
    }
  }
  return schedule;
}

}  // namespace vorocast::simulation
