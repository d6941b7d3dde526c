// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "services/geometry/vector.h"

namespace vorocast::tracking {

/// An undirected graph as compressed rows: node i has the arcs offset[i] … offset[i+1]−1.
struct Graph {
  std::vector<std::int32_t> offset;  // [nodes+1]
  std::vector<std::int32_t> target;  // [arcs]
  std::vector<double> length;        // [arcs] positive, metres

  std::int32_t size() const { return static_cast<std::int32_t>(offset.size()) - 1; }
};

/// The graph over points joined by `pairs` (each once), with the distances between the points as lengths.
Graph GraphOfPoints(const std::vector<geometry::Vec3>& points, const std::vector<std::array<std::int32_t, 2>>& pairs);

/// k-medoids by graph distance: the cluster of each node. Clusters are connected in the graph and numbered without gaps. Connected parts of the graph
/// share `count` by their number of nodes, at least one each: there are max(count, parts) clusters, but never more than nodes. Deterministic in the
/// seed.
std::vector<std::int32_t> ClusterGraph(const Graph& graph, std::int32_t count, std::uint64_t seed);

}  // namespace vorocast::tracking
