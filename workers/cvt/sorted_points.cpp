// SPDX-License-Identifier: AGPL-3.0-or-later
#include "workers/cvt/sorted_points.h"

namespace vorocast::cvt {

SortedPoints::SortedPoints(const geometry::OrientedPoints& points, const GridFrame& frame, float bucket) : bucket_(bucket) {
  for (std::size_t axis = 0; axis < 3; ++axis) buckets_[axis] = static_cast<std::int32_t>(static_cast<float>(frame.nodes[axis]) / bucket) + 1;
  first_.assign(BucketIndex(buckets_[0] - 1, buckets_[1] - 1, buckets_[2] - 1) + 2, 0);

  // A counting sort: stable, so points of one bucket keep their input order.
  std::vector<std::size_t> bucket_of(points.size());
  for (std::size_t p = 0; p < points.size(); ++p) {
    const geometry::Vec3f u = frame.ToGrid(points.positions[p]);
    std::array<std::int32_t, 3> b;
    for (int a = 0; a < 3; ++a) {
      const std::size_t axis = static_cast<std::size_t>(a);
      b[axis] = std::clamp(static_cast<std::int32_t>(std::floor(u[a] / bucket_)), 0, buckets_[axis] - 1);
    }
    bucket_of[p] = BucketIndex(b[0], b[1], b[2]);
    ++first_[bucket_of[p] + 1];
  }
  for (std::size_t b = 1; b < first_.size(); ++b) first_[b] += first_[b - 1];
  points_.resize(points.size());
  std::vector<std::int32_t> next(first_.begin(), first_.end() - 1);
  for (std::size_t p = 0; p < points.size(); ++p) {
    points_[static_cast<std::size_t>(next[bucket_of[p]]++)] = {frame.ToGrid(points.positions[p]), points.normals[p].cast<float>(), 0};
  }
}

}  // namespace vorocast::cvt
