// SPDX-License-Identifier: AGPL-3.0-or-later
#include <fmt/format.h>

#include "workers/tracking/graph_clustering.h"
#include "workers/tracking/tracking.h"

namespace vorocast::tracking {

absl::StatusOr<std::vector<std::int32_t>> ClusterPatches(const geometry::Cells& cells, std::int32_t count, std::uint64_t seed) {
  if (cells.size() == 0) return absl::InvalidArgumentError("cluster patches: the template has no cells");
  if (count < 1) return absl::InvalidArgumentError(fmt::format("cluster patches: {} patches asked for; ask for at least 1", count));
  auto pairs = geometry::NeighbourPairs(cells);
  if (!cells.component.empty()) {
    std::erase_if(pairs, [&](const auto& pair) { return cells.component[pair[0]] != cells.component[pair[1]]; });
  }
  return ClusterGraph(GraphOfPoints(cells.centroid, pairs), count, seed);
}

}  // namespace vorocast::tracking
