// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <limits>
#include <vector>

#include "services/geometry/vector.h"
#include "workers/cvt/lanes.h"

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

  /// Calls visit(entry) for the sites less than sqrt(radius_squared) from `centre`, in the order of the boxes.
  template <typename Visit>
  void Within(const geometry::Vec3& centre, double radius_squared, Visit&& visit) const;

 private:
  /// A box relative to another one, and the least squared distance between points of the two, in box sides.
  struct Offset {
    std::array<std::int32_t, 3> step;
    double distance_squared;
  };
  static constexpr std::int32_t kRings = 5;
  static const std::vector<Offset>& SortedOffsets();

  std::array<std::int32_t, 3> BoxOf(const geometry::Vec3& point) const;
  /// From the point to the slab of boxes numbered `box` along an axis; infinite when there is no such slab.
  double SquaredGap(const geometry::Vec3& point, int axis, std::int32_t box) const {
    if (box < 0 || box >= size_[axis]) return std::numeric_limits<double>::infinity();
    const double at = point[axis] - low_[axis];
    const double gap = std::max({box * side_ - at, at - (box + 1) * side_, 0.0});
    // A site on the border of two boxes may have been filed in either: never cut it off by rounding.
    return gap * gap * (1 - 1e-9);
  }
  std::int64_t Index(const std::array<std::int32_t, 3>& box) const {
    return (static_cast<std::int64_t>(box[2]) * size_[1] + box[1]) * size_[0] + box[0];
  }
  Entry At(std::int32_t e) const { return {{x_[e], y_[e], z_[e]}, site_[e]}; }
  template <typename Visit>
  void VisitBox(std::int64_t box, Visit&& visit) const {
    for (std::int32_t e = begin_[box]; e < begin_[box + 1]; ++e) visit(At(e));
  }

  geometry::Vec3 low_ = geometry::Vec3::Zero();
  double side_ = 1;
  std::array<std::int32_t, 3> size_{1, 1, 1};
  std::vector<std::int32_t> begin_;
  std::vector<double> x_, y_, z_;   // by box; padded by 4 places infinitely far away
  std::vector<std::int32_t> site_;  // as x_
};

template <typename Radius, typename Visit>
void SiteGrid::Around(const geometry::Vec3& centre, Radius&& radius_squared, Visit&& visit) const {
  const std::array<std::int32_t, 3> home = BoxOf(centre);
  const double side_squared = side_ * side_;
  // Squared gaps to the slabs of boxes around, by axis; boxes that do not exist are infinitely far away.
  std::array<std::array<double, 2 * kRings + 1>, 3> gap;
  const auto rings = static_cast<std::int32_t>(std::min<double>(kRings, std::sqrt(radius_squared()) / side_ + 1));
  for (int a = 0; a < 3; ++a) {
    for (std::int32_t d = -rings; d <= rings; ++d) gap[a][d + kRings] = SquaredGap(centre, a, home[a] + d);
  }
  const std::int64_t first = Index(home);
  const std::int64_t row = size_[0];
  const std::int64_t sheet = row * size_[1];
  for (const Offset& offset : SortedOffsets()) {
    if (offset.distance_squared * side_squared > radius_squared()) return;
    const auto& [x, y, z] = offset.step;
    if (gap[0][x + kRings] + gap[1][y + kRings] + gap[2][z + kRings] > radius_squared()) continue;
    VisitBox(first + z * sheet + y * row + x, visit);
  }
  // Few sites, or a far-reaching cell: go on ring by ring.
  for (std::int32_t ring = kRings + 1;; ++ring) {
    const double nearest = (ring - 1) * side_;
    if (nearest * nearest > radius_squared() || ring > std::max({size_[0], size_[1], size_[2]})) return;
    for (std::int32_t z = std::max(home[2] - ring, 0); z <= std::min(home[2] + ring, size_[2] - 1); ++z) {
      for (std::int32_t y = std::max(home[1] - ring, 0); y <= std::min(home[1] + ring, size_[1] - 1); ++y) {
        const bool shell = std::abs(z - home[2]) == ring || std::abs(y - home[1]) == ring;
        for (std::int32_t x = home[0] - ring; x <= home[0] + ring; x += shell ? 1 : 2 * ring) {
          if (SquaredGap(centre, 0, x) + SquaredGap(centre, 1, y) + SquaredGap(centre, 2, z) <= radius_squared()) VisitBox(Index({x, y, z}), visit);
        }
      }
    }
  }
}

template <typename Visit>
void SiteGrid::Within(const geometry::Vec3& centre, double radius_squared, Visit&& visit) const {
  const geometry::Vec3 radius = geometry::Vec3::Constant(std::sqrt(radius_squared) * (1 + 1e-9));
  const std::array<std::int32_t, 3> low = BoxOf(centre - radius);
  const std::array<std::int32_t, 3> high = BoxOf(centre + radius);
  const Lanes limit = Splat(radius_squared);
  for (std::int32_t z = low[2]; z <= high[2]; ++z) {
    const double gap = SquaredGap(centre, 2, z);
    for (std::int32_t y = low[1]; y <= high[1]; ++y) {
      if (gap + SquaredGap(centre, 1, y) > radius_squared) continue;
      // Boxes along x follow one another.
      const std::int32_t end = begin_[Index({high[0], y, z}) + 1];
      for (std::int32_t e = begin_[Index({low[0], y, z})]; e < end; e += 4) {
        const Lanes dx = LoadLanes(&x_[e]) - centre.x();
        const Lanes dy = LoadLanes(&y_[e]) - centre.y();
        const Lanes dz = LoadLanes(&z_[e]) - centre.z();
        unsigned bits = BitsOf(dx * dx + dy * dy + dz * dz < limit);
        if (end - e < 4) bits &= (1U << (end - e)) - 1;
        for (; bits != 0; bits &= bits - 1) visit(At(e + std::countr_zero(bits)));
      }
    }
  }
}

}  // namespace vorocast::cvt
