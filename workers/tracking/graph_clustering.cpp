// SPDX-License-Identifier: AGPL-3.0-or-later
#include "workers/tracking/graph_clustering.h"

#include <algorithm>
#include <functional>
#include <limits>
#include <numeric>
#include <queue>
#include <utility>

#include "services/base/random.h"

namespace vorocast::tracking {
namespace {

constexpr double kFar = std::numeric_limits<double>::infinity();
constexpr std::int32_t kRounds = 20;
constexpr int kSeedTrials = 3;

using Entry = std::pair<double, std::int32_t>;  // distance, node; ties are broken by the node, so that the order is always the same
using Queue = std::priority_queue<Entry, std::vector<Entry>, std::greater<Entry>>;

/// Nodes of each connected part, ascending.
std::vector<std::vector<std::int32_t>> ConnectedParts(const Graph& graph) {
  std::vector<std::vector<std::int32_t>> parts;
  std::vector<bool> seen(static_cast<std::size_t>(graph.size()), false);
  for (std::int32_t start = 0; start < graph.size(); ++start) {
    if (seen[start]) continue;
    std::vector<std::int32_t> part{start};
    seen[start] = true;
    for (std::size_t i = 0; i < part.size(); ++i) {
      for (std::int32_t a = graph.offset[part[i]]; a < graph.offset[part[i] + 1]; ++a) {
        if (seen[graph.target[a]]) continue;
        seen[graph.target[a]] = true;
        part.push_back(graph.target[a]);
      }
    }
    std::ranges::sort(part);
    parts.push_back(std::move(part));
  }
  return parts;
}

/// Shares `count` between parts by size, at least one and at most size each (largest remainders first).
std::vector<std::int32_t> ShareClusters(const std::vector<std::vector<std::int32_t>>& parts, std::int32_t count) {
  double nodes = 0;
  for (const auto& part : parts) nodes += static_cast<double>(part.size());
  std::vector<std::int32_t> share(parts.size(), 1);
  auto remaining = count - static_cast<std::int32_t>(parts.size());
  while (remaining > 0) {
    // The part that lacks most against its fair share gets the next cluster.
    std::size_t neediest = parts.size();
    double lack_max = -kFar;
    for (std::size_t i = 0; i < parts.size(); ++i) {
      if (share[i] >= static_cast<std::int32_t>(parts[i].size())) continue;
      const double lack = count * static_cast<double>(parts[i].size()) / nodes - share[i];
      if (lack > lack_max) lack_max = lack, neediest = i;
    }
    if (neediest == parts.size()) break;
    ++share[neediest];
    --remaining;
  }
  return share;
}

/// Clusters one connected part of the graph; distances and labels of other nodes are not touched.
class PartClusterer {
 public:
  PartClusterer(const Graph& graph, const std::vector<std::int32_t>& nodes, std::uint64_t seed)
      : graph_(graph),
        nodes_(nodes),
        random_(seed),
        distance_(static_cast<std::size_t>(graph.size()), kFar),
        label_(static_cast<std::size_t>(graph.size()), -1),
        inner_distance_(static_cast<std::size_t>(graph.size()), kFar) {}

  /// Writes the labels 0 … count−1 of the part's nodes plus `first_label` into `labels`.
  void Run(std::int32_t count, std::int32_t first_label, std::vector<std::int32_t>& labels) {
    SeedMedoids(count);
    for (std::int32_t round = 0; round < kRounds; ++round) {
      Assign();
      if (!MoveMedoids()) break;
    }
    Assign();
    for (std::int32_t node : nodes_) labels[node] = first_label + label_[node];
  }

 private:
  /// Squared distances to the nearest medoid that a further medoid at `node` would save; commits the medoid when told to.
  double Gain(std::int32_t node, bool commit) {
    double gain = 0;
    std::vector<Entry> reached;
    Queue queue;
    queue.push({0.0, node});
    std::vector<std::int32_t> touched;
    while (!queue.empty()) {
      const auto [d, i] = queue.top();
      queue.pop();
      if (d >= distance_[i] || d >= inner_distance_[i]) continue;
      inner_distance_[i] = d;
      touched.push_back(i);
      const double before = distance_[i] == kFar ? 0 : distance_[i] * distance_[i];
      gain += before - d * d;
      for (std::int32_t a = graph_.offset[i]; a < graph_.offset[i + 1]; ++a) queue.push({d + graph_.length[a], graph_.target[a]});
    }
    for (std::int32_t i : touched) {
      if (commit) distance_[i] = inner_distance_[i];
      inner_distance_[i] = kFar;
    }
    return gain;
  }

  /// k-means++: the next medoid is drawn with probability proportional to the squared distance, the best of a few draws is kept.
  void SeedMedoids(std::int32_t count) {
    medoids_.push_back(nodes_[random_.Below(nodes_.size())]);
    Gain(medoids_.back(), true);
    while (static_cast<std::int32_t>(medoids_.size()) < count) {
      double total = 0;
      for (std::int32_t i : nodes_) total += distance_[i] * distance_[i];
      std::int32_t best = -1;
      double best_gain = -1;
      for (int trial = 0; trial < kSeedTrials; ++trial) {
        double rest = random_.Uniform() * total;
        std::int32_t drawn = -1;
        for (std::int32_t i : nodes_) {
          if (distance_[i] == 0) continue;
          drawn = i;
          rest -= distance_[i] * distance_[i];
          if (rest < 0) break;
        }
        const double gain = Gain(drawn, false);
        if (gain > best_gain) best_gain = gain, best = drawn;
      }
      medoids_.push_back(best);
      Gain(best, true);
    }
  }

  /// Labels every node with its nearest medoid. A node inherits the label along its shortest path, so clusters are connected.
  void Assign() {
    for (std::int32_t i : nodes_) distance_[i] = kFar, label_[i] = -1;
    Queue queue;
    for (std::size_t m = 0; m < medoids_.size(); ++m) {
      distance_[medoids_[m]] = 0;
      label_[medoids_[m]] = static_cast<std::int32_t>(m);
      queue.push({0.0, medoids_[m]});
    }
    while (!queue.empty()) {
      const auto [d, i] = queue.top();
      queue.pop();
      if (d > distance_[i]) continue;
      for (std::int32_t a = graph_.offset[i]; a < graph_.offset[i + 1]; ++a) {
        const std::int32_t j = graph_.target[a];
        if (d + graph_.length[a] >= distance_[j]) continue;
        distance_[j] = d + graph_.length[a];
        label_[j] = label_[i];
        queue.push({distance_[j], j});
      }
    }
  }

  /// Sum of squared distances inside its cluster from `node`, or more than `limit`.
  double SpreadFrom(std::int32_t node, const std::vector<std::int32_t>& members, double limit) {
    for (std::int32_t i : members) inner_distance_[i] = kFar;
    Queue queue;
    queue.push({0.0, node});
    inner_distance_[node] = 0;
    double spread = 0;
    while (!queue.empty() && spread <= limit) {
      const auto [d, i] = queue.top();
      queue.pop();
      if (d > inner_distance_[i]) continue;
      spread += d * d;
      for (std::int32_t a = graph_.offset[i]; a < graph_.offset[i + 1]; ++a) {
        const std::int32_t j = graph_.target[a];
        if (label_[j] != label_[node] || d + graph_.length[a] >= inner_distance_[j]) continue;
        inner_distance_[j] = d + graph_.length[a];
        queue.push({inner_distance_[j], j});
      }
    }
    for (std::int32_t i : members) inner_distance_[i] = kFar;
    return spread;
  }

  bool MoveMedoids() {
    std::vector<std::vector<std::int32_t>> members(medoids_.size());
    for (std::int32_t i : nodes_) members[label_[i]].push_back(i);
    bool moved = false;
    for (std::size_t m = 0; m < medoids_.size(); ++m) {
      double best = SpreadFrom(medoids_[m], members[m], kFar);
      for (std::int32_t candidate : members[m]) {
        const double spread = SpreadFrom(candidate, members[m], best);
        if (spread < best) best = spread, medoids_[m] = candidate, moved = true;
      }
    }
    return moved;
  }

  const Graph& graph_;
  const std::vector<std::int32_t>& nodes_;
  base::Random random_;
  std::vector<std::int32_t> medoids_;
  std::vector<double> distance_;  // to the nearest medoid
  std::vector<std::int32_t> label_;
  std::vector<double> inner_distance_;  // scratch, kFar between uses
};

}  // namespace

Graph GraphOfPoints(const std::vector<geometry::Vec3>& points, const std::vector<std::array<std::int32_t, 2>>& pairs) {
  Graph graph;
  graph.offset.assign(points.size() + 1, 0);
  for (const auto& [a, b] : pairs) ++graph.offset[a + 1], ++graph.offset[b + 1];
  std::partial_sum(graph.offset.begin(), graph.offset.end(), graph.offset.begin());
  graph.target.resize(2 * pairs.size());
  graph.length.resize(2 * pairs.size());
  std::vector<std::int32_t> next(graph.offset.begin(), graph.offset.end() - 1);
  for (const auto& [a, b] : pairs) {
    // Coincident points would make a medoid at distance zero from another.
    const double length = std::max((points[a] - points[b]).norm(), 1e-9);
    graph.target[next[a]] = b, graph.length[next[a]++] = length;
    graph.target[next[b]] = a, graph.length[next[b]++] = length;
  }
  return graph;
}

std::vector<std::int32_t> ClusterGraph(const Graph& graph, std::int32_t count, std::uint64_t seed) {
  std::vector<std::int32_t> labels(static_cast<std::size_t>(graph.size()), -1);
  const auto parts = ConnectedParts(graph);
  const auto share = ShareClusters(parts, std::min(count, graph.size()));
  std::int32_t first_label = 0;
  for (std::size_t i = 0; i < parts.size(); ++i) {
    PartClusterer(graph, parts[i], seed + i).Run(share[i], first_label, labels);
    first_label += share[i];
  }
  return labels;
}

}  // namespace vorocast::tracking
