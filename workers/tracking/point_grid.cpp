// SPDX-License-Identifier: AGPL-3.0-or-later
#include "workers/tracking/point_grid.h"

#include <numeric>

namespace vorocast::tracking {

void PointGrid::Build(const std::vector<PosedPoint>& points, float cell_m) {
  constexpr double kCellsMax = 4e6;
  size_.setZero();
  points_.resize(points.size());
  if (points.empty()) return;
  Eigen::AlignedBox3f box;
  for (const PosedPoint& point : points) box.extend(point.position);
  low_ = box.min();
  const geometry::Vec3 extent = box.sizes().cast<double>();
  double cell = cell_m;
  while ((extent / cell + geometry::Vec3::Ones()).prod() > kCellsMax) cell *= 1.5;
  inverse_cell_ = static_cast<float>(1 / cell);
  const auto cell_of = [&](const geometry::Vec3f& x) {
    const Eigen::Vector3i c = ((x - low_) * inverse_cell_).cast<int>().cwiseMin(size_ - Eigen::Vector3i::Ones());
    return (static_cast<std::size_t>(c.z()) * size_.y() + c.y()) * size_.x() + c.x();
  };
  size_ = (extent / cell).cast<int>() + Eigen::Vector3i::Ones();
  start_.assign(static_cast<std::size_t>(size_.x()) * size_.y() * size_.z() + 1, 0);
  for (const PosedPoint& point : points) ++start_[cell_of(point.position) + 1];
  std::partial_sum(start_.begin(), start_.end(), start_.begin());
  // Filled from the back, each cell's end moves down to its start, so no second array of cursors is needed.
  for (std::size_t i = points.size(); i-- > 0;) {
    std::int32_t& end = start_[cell_of(points[i].position) + 1];
    points_[--end] = points[i];
  }
  // Now start_[c + 1] holds the start of cell c: shift it into place.
  std::rotate(start_.begin(), start_.begin() + 1, start_.end());
  start_.back() = static_cast<std::int32_t>(points.size());
}

}  // namespace vorocast::tracking
