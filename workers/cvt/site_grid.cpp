// SPDX-License-Identifier: AGPL-3.0-or-later
#include "workers/cvt/site_grid.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <tuple>

namespace vorocast::cvt {

using geometry::Vec3;

const std::vector<SiteGrid::Offset>& SiteGrid::SortedOffsets() {
  static const std::vector<Offset> offsets = [] {
    std::vector<Offset> all;
    for (std::int32_t z = -kRings; z <= kRings; ++z) {
      for (std::int32_t y = -kRings; y <= kRings; ++y) {
        for (std::int32_t x = -kRings; x <= kRings; ++x) {
          double squared = 0;
          for (std::int32_t d : {x, y, z}) {
            const double gap = std::max(std::abs(d) - 1, 0);
            squared += gap * gap;
          }
          all.push_back({{x, y, z}, squared});
        }
      }
    }
    std::ranges::stable_sort(all, [](const Offset& a, const Offset& b) {
      const auto length = [](const Offset& o) { return o.step[0] * o.step[0] + o.step[1] * o.step[1] + o.step[2] * o.step[2]; };
      return std::make_tuple(a.distance_squared, length(a)) < std::make_tuple(b.distance_squared, length(b));
    });
    return all;
  }();
  return offsets;
}

void SiteGrid::Build(const std::vector<Vec3>& sites, double side) {
  geometry::Box3 box;
  for (const Vec3& site : sites) box.extend(site);
  low_ = box.min();
  const Vec3 size = box.sizes();
  // A grid far larger than its sites (a thin plate across its box's diagonal) would cost more to clear than it saves.
  const double boxes_max = 64.0 * static_cast<double>(sites.size()) + 4096;
  const auto boxes = [&] {
    double product = 1;
    for (int a = 0; a < 3; ++a) product *= std::floor(size[a] / side_) + 1;
    return product;
  };
  side_ = std::max(side, 1e-300);
  while (boxes() > boxes_max) side_ *= 1.25;
  for (int a = 0; a < 3; ++a) size_[a] = static_cast<std::int32_t>(std::floor(size[a] / side_)) + 1;

  begin_.assign(static_cast<std::size_t>(size_[0]) * size_[1] * size_[2] + 1, 0);
  const auto index = [&](const Vec3& site) { return static_cast<std::size_t>(Index(BoxOf(site))); };
  for (const Vec3& site : sites) ++begin_[index(site) + 1];
  for (std::size_t b = 1; b < begin_.size(); ++b) begin_[b] += begin_[b - 1];
  for (auto* values : {&x_, &y_, &z_}) values->assign(sites.size() + 4, std::numeric_limits<double>::infinity());
  site_.resize(sites.size());
  std::vector<std::int32_t> next(begin_.begin(), begin_.end() - 1);
  for (std::size_t i = 0; i < sites.size(); ++i) {
    const std::int32_t e = next[index(sites[i])]++;
    x_[e] = sites[i].x(), y_[e] = sites[i].y(), z_[e] = sites[i].z();
    site_[e] = static_cast<std::int32_t>(i);
  }
}

std::array<std::int32_t, 3> SiteGrid::BoxOf(const Vec3& point) const {
  std::array<std::int32_t, 3> box;
  for (int a = 0; a < 3; ++a) box[a] = static_cast<std::int32_t>(std::clamp((point[a] - low_[a]) / side_, 0.0, size_[a] - 1.0));
  return box;
}

std::int32_t SiteGrid::Nearest(const Vec3& point) const {
  std::int32_t best = -1;
  double best_squared = std::numeric_limits<double>::max();  // less than the distance to boxes that do not exist
  Around(
      point, [&] { return best_squared; },
      [&](const Entry& entry) {
        const double squared = SquaredDistance(point, entry.position);
        if (squared < best_squared || (squared == best_squared && entry.site < best)) best = entry.site, best_squared = squared;
      });
  return best;
}

}  // namespace vorocast::cvt
