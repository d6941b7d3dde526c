// SPDX-License-Identifier: AGPL-3.0-or-later
#include "services/simulation/mask.h"

#include <algorithm>

namespace vorocast::simulation {
namespace {

using geometry::Vec3;

/// 1 at 0 and below, 0 from `soft` on, a straight line between.
double Fade(double outside, double soft) {
  if (outside <= 0) return 1;
  return outside < soft ? 1 - outside / soft : 0;
}

double InRange(double x, const std::array<double, 2>& range, double soft) { return Fade(std::max(range[0] - x, x - range[1]), soft); }

double InList(std::int32_t x, const std::optional<std::vector<std::int32_t>>& list) {
  return !list || std::ranges::find(*list, x) != list->end() ? 1 : 0;
}

double Painted(const Vec3& x, const std::vector<MaskSettings::Ball>& painted) {
  if (painted.empty()) return 1;
  double most = 0;
  for (const MaskSettings::Ball& ball : painted) most = std::max(most, Fade((x - ball.position_m).norm() - ball.radius_m, ball.soft_m));
  return most;
}

}  // namespace

MaskSubject::MaskSubject(const geometry::Template& model_in, const TrackedMotion& motion, const Vec3& take_origin) : model(model_in) {
  const geometry::Rigid3* first = motion.AtFrame(0);
  const std::size_t n = motion.cell_count();
  double bottom = first[0].translation.y();
  double top = bottom;
  for (std::size_t c = 0; c < n; ++c) {
    centre.emplace_back(first[c].translation - take_origin);
    bottom = std::min(bottom, first[c].translation.y());
    top = std::max(top, first[c].translation.y());
  }
  const double size = std::max(top - bottom, 1e-9);
  for (std::size_t c = 0; c < n; ++c) height.push_back((first[c].translation.y() - bottom) / size);
}

std::vector<double> MaskWeights(const MaskSettings& mask, const MaskSubject& subject) {
  std::vector<double> weights;
  weights.reserve(subject.centre.size());
  for (std::size_t c = 0; c < subject.centre.size(); ++c) {
    const double weight = InList(subject.model.cells.component[c], mask.components) * InList(subject.model.patch[c], mask.patches) *
                          InRange(subject.height[c], mask.height, mask.height_soft) *
                          InRange(subject.model.cells.depth[c], mask.depth_m, mask.depth_soft_m) * Painted(subject.centre[c], mask.painted);
    weights.push_back(mask.invert ? 1 - weight : weight);
  }
  return weights;
}

}  // namespace vorocast::simulation
