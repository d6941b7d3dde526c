// SPDX-License-Identifier: AGPL-3.0-or-later
#include <algorithm>
#include <limits>

#include "workers/tracking/tracking.h"

namespace vorocast::tracking {
namespace {

using geometry::Vec3;

struct Share {
  std::int32_t cell;
  double weight;
};

/// Each cell and the cells it shares a face with, itself first.
std::vector<std::vector<std::int32_t>> CellsAround(const geometry::Cells& cells) {
  std::vector<std::vector<std::int32_t>> around(cells.size());
  for (std::size_t c = 0; c < cells.size(); ++c) around[c].push_back(static_cast<std::int32_t>(c));
  for (const auto& [a, b] : geometry::NeighbourPairs(cells)) {
    if (!cells.component.empty() && cells.component[a] != cells.component[b]) continue;
    around[a].push_back(b);
    around[b].push_back(a);
  }
  return around;
}

std::size_t NearestCell(const geometry::Cells& cells, const Vec3& x) {
  std::size_t nearest = 0;
  double least = std::numeric_limits<double>::infinity();
  for (std::size_t c = 0; c < cells.size(); ++c) {
    // By site: the nearest site's Voronoi cell is the one that holds the point.
    const double squared = (cells.sites[c] - x).squaredNorm();
    if (squared < least) least = squared, nearest = c;
  }
  return nearest;
}

/// The cell that holds the point and those beside it, by a weight that falls to zero at the farthest of them.
std::vector<Share> SharesOf(const geometry::Cells& cells, const std::vector<std::int32_t>& around, const Vec3& x) {
  double farthest = 0;
  for (const std::int32_t c : around) farthest = std::max(farthest, (cells.centroid[c] - x).norm());
  std::vector<Share> shares;
  double total = 0;
  for (const std::int32_t c : around) {
    const double near = around.size() == 1 ? 1 : 1 - (cells.centroid[c] - x).norm() / farthest;
    if (near <= 0) continue;
    shares.push_back({c, near * near});
    total += near * near;
  }
  if (shares.empty()) return {{around[0], 1.0}};
  for (Share& share : shares) share.weight /= total;
  return shares;
}

}  // namespace

std::vector<Vec3> CarryPoints(const geometry::TrackedTake& take, const std::vector<Vec3>& template_points) {
  const geometry::Cells& cells = take.model.cells;
  std::vector<Vec3> carried;
  if (cells.size() == 0) return carried;
  const auto around = CellsAround(cells);
  std::vector<std::vector<Share>> shares;
  shares.reserve(template_points.size());
  for (const Vec3& x : template_points) shares.push_back(SharesOf(cells, around[NearestCell(cells, x)], x));

  carried.reserve(take.frame_count() * template_points.size());
  std::vector<geometry::Rigid3> pose(cells.size());
  for (std::size_t f = 0; f < take.frame_count(); ++f) {
    for (std::size_t c = 0; c < cells.size(); ++c) pose[c] = take.CellPose(f, c);
    for (std::size_t i = 0; i < template_points.size(); ++i) {
      Vec3 sum = Vec3::Zero();
      for (const Share& share : shares[i]) sum += share.weight * (pose[share.cell] * template_points[i]);
      carried.push_back(sum);
    }
  }
  return carried;
}

}  // namespace vorocast::tracking
