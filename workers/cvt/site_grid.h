// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <cstdlib>
#include <vector>

#include "services/geometry/vector.h"

namespace vorocast::cvt {

/// |a − b|² by one expression everywhere: comparisons of such values agree wherever they are made, which clipping relies on.
inline double SquaredDistance(const geometry::Vec3& a, const geometry::Vec3& b) {
  const double x = a.x() - b.x();
  const double y = a.y() - b.y();
  const double z = a.z() - b.z();
  return x * x + y * y + z * z;
}

/// Sites in a uniform grid.
class SiteGrid {
 public:
  struct Entry {
    geometry::Vec3 position;
    std::int32_t site;
  };

  /// Boxes of the given side, best about the spacing of the sites; larger where there would be far more boxes than sites.
  void Build(const std::vector<geometry::Vec3>& sites, double side);

  /// The site nearest to a point; of equally near ones the lowest.
  std::int32_t Nearest(const geometry::Vec3& point) const;

  /// Calls visit(entry) for the sites around `centre`, near boxes before far ones, until the boxes left are further than
  /// sqrt(radius_squared()), which is asked again after every box because visits may shrink it.
  template <typename Radius, typename Visit>
  void Around(const geometry::Vec3& centre, Radius&& radius_squared, Visit&& visit) const;

 private:
  /// A box relative to another one, and the least squared distance between points of the two, in box sides.
  struct Offset {
    std::array<std::int32_t, 3> step;
    double distance_squared;
  };
  static constexpr std::int32_t kRings = 5;
  static const std::vector<Offset>& SortedOffsets();

  std::array<std::int32_t, 3> BoxOf(const geometry::Vec3& point) const;
  double SquaredDistanceToBox(const geometry::Vec3& point, const std::array<std::int32_t, 3>& box) const;
  template <typename Visit>
  void VisitBox(const std::array<std::int32_t, 3>& box, Visit&& visit) const {
    const std::size_t b = (static_cast<std::size_t>(box[2]) * size_[1] + box[1]) * size_[0] + box[0];
    for (std::int32_t e = begin_[b]; e < begin_[b + 1]; ++e) visit(entries_[e]);
  }

  geometry::Vec3 low_ = geometry::Vec3::Zero();
  double side_ = 1;
  std::array<std::int32_t, 3> size_{1, 1, 1};
  std::vector<std::int32_t> begin_;
  std::vector<Entry> entries_;
};

template <typename Radius, typename Visit>
void SiteGrid::Around(const geometry::Vec3& centre, Radius&& radius_squared, Visit&& visit) const {
  const std::array<std::int32_t, 3> home = BoxOf(centre);
  const double side_squared = side_ * side_;
  const auto look = [&](std::int32_t x, std::int32_t y, std::int32_t z) {
    if (x < 0 || y < 0 || z < 0 || x >= size_[0] || y >= size_[1] || z >= size_[2]) return;
    const std::array<std::int32_t, 3> box{x, y, z};
    if (SquaredDistanceToBox(centre, box) <= radius_squared()) VisitBox(box, visit);
  };
  for (const Offset& offset : SortedOffsets()) {
    if (offset.distance_squared * side_squared > radius_squared()) return;
    look(home[0] + offset.step[0], home[1] + offset.step[1], home[2] + offset.step[2]);
  }
  // Few sites, or a far-reaching cell: go on ring by ring.
  for (std::int32_t ring = kRings + 1;; ++ring) {
    const double gap = (ring - 1) * side_;
    if (gap * gap > radius_squared() || ring > std::max({size_[0], size_[1], size_[2]})) return;
    for (std::int32_t z = std::max(home[2] - ring, 0); z <= std::min(home[2] + ring, size_[2] - 1); ++z) {
      for (std::int32_t y = std::max(home[1] - ring, 0); y <= std::min(home[1] + ring, size_[1] - 1); ++y) {
        const bool shell = std::abs(z - home[2]) == ring || std::abs(y - home[1]) == ring;
        for (std::int32_t x = home[0] - ring; x <= home[0] + ring; x += shell ? 1 : 2 * ring) look(x, y, z);
      }
    }
  }
}

}  // namespace vorocast::cvt
