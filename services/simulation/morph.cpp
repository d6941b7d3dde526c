// SPDX-License-Identifier: AGPL-3.0-or-later
#include "services/simulation/morph.h"

#include <LinearMath/btConvexHullComputer.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "services/simulation/assignment.h"

namespace vorocast::simulation {
namespace {

using geometry::Cells;
using geometry::CellState;
using geometry::Quat;
using geometry::Rigid3;
using geometry::Vec3;
using Triangle = std::array<std::int32_t, 3>;

/// Places of cells, comparable between two bodies: from the middle of the foot, heights as shares of the body's times a common height.
std::vector<Vec3> Comparable(const TrackedMotion& motion, double time) {
  std::vector<Rigid3> poses;
  motion.Sample(time, poses);
  geometry::Box3 box;
  for (const Rigid3& pose : poses) box.extend(pose.translation);
  constexpr double kCommonHeight = 1.75;
  const double up = kCommonHeight / std::max(box.sizes().y(), 1e-6);
  std::vector<Vec3> places;
  for (const Rigid3& pose : poses) {
    const Vec3 x = pose.translation - Vec3(box.center().x(), box.min().y(), box.center().z());
    places.emplace_back(x.x(), up * x.y(), x.z());
  }
  return places;
}

/// Share of the body's cells that lie less deep. [n]
std::vector<double> DepthRank(const Cells& cells) {
  std::vector<std::size_t> order(cells.size());
  for (std::size_t c = 0; c < order.size(); ++c) order[c] = c;
  std::ranges::stable_sort(order, {}, [&](std::size_t c) { return cells.depth[c]; });
  std::vector<double> rank(cells.size());
  for (std::size_t i = 0; i < order.size(); ++i)
    rank[order[i]] = static_cast<double>(i) / static_cast<double>(std::max<std::size_t>(order.size() - 1, 1));
  return rank;
}

std::vector<double> HeightRank(const std::vector<Vec3>& places) {
  double top = 1e-9;
  for (const Vec3& x : places) top = std::max(top, x.y());
  std::vector<double> rank;
  for (const Vec3& x : places) rank.push_back(x.y() / top);
  return rank;
}

/// When the source's cells go: 0 the first, 1 the last. [n]
std::vector<double> OrderOf(const MorphSettings& settings, const std::vector<double>& depth_rank, const std::vector<Vec3>& places) {
  using Order = MorphSettings::Order;
  std::vector<double> order = depth_rank;
  if (settings.order == Order::kTopDown || settings.order == Order::kBottomUp) order = HeightRank(places);
  for (double& o : order) {
    if (settings.order == Order::kInsideOut || settings.order == Order::kTopDown) o = 1 - o;
    if (settings.order == Order::kTogether) o = 0;
  }
  return order;
}

/// Corners of a cell about its centroid, in template axes.
std::vector<Vec3> CornersOf(const Cells& cells, std::size_t c) {
  std::vector<std::int32_t> indices;
  const auto first = static_cast<std::size_t>(cells.vertex_offset[static_cast<std::size_t>(cells.face_offset[c])]);
  const auto last = static_cast<std::size_t>(cells.vertex_offset[static_cast<std::size_t>(cells.face_offset[c + 1])]);
  for (std::size_t i = first; i < last; ++i) indices.push_back(cells.vertex[i]);
  std::ranges::sort(indices);
  const auto repeated = std::ranges::unique(indices);
  indices.erase(repeated.begin(), repeated.end());
  std::vector<Vec3> corners;
  for (const std::int32_t v : indices) corners.push_back(cells.vertices[static_cast<std::size_t>(v)] - cells.centroid[c]);
  return corners;
}

/// A hull's corners by their index in the input, and its faces as triangles, outwards.
struct IndexedHull {
  std::vector<std::int32_t> corner;
  std::vector<Triangle> triangles;
};
IndexedHull HullOf(const std::vector<Vec3>& points) {
  constexpr double kUnitsPerMetre = 1000;
  std::vector<double> coordinates;
  for (const Vec3& point : points) {
    for (const double x : point) coordinates.push_back(kUnitsPerMetre * x);
  }
  btConvexHullComputer computer;
  computer.compute(coordinates.data(), 3 * sizeof(double), static_cast<int>(points.size()), 0, 0);
  IndexedHull hull;
  for (int i = 0; i < computer.vertices.size(); ++i) hull.corner.push_back(computer.original_vertex_index[i]);
  for (int f = 0; f < computer.faces.size(); ++f) {
    const auto* first = &computer.edges[computer.faces[f]];
    const std::int32_t a = first->getSourceVertex();
    for (const auto* edge = first->getNextEdgeOfFace(); edge->getTargetVertex() != a; edge = edge->getNextEdgeOfFace())
      hull.triangles.push_back({a, edge->getSourceVertex(), edge->getTargetVertex()});
  }
  return hull;
}

double SignedVolumeOf(const std::vector<Vec3>& corners, const std::vector<Triangle>& triangles) {
  double six = 0;
  for (const auto& [a, b, c] : triangles) {
    const auto at = [&](std::int32_t i) -> const Vec3& { return corners[static_cast<std::size_t>(i)]; };
    six += at(a).dot(at(b).cross(at(c)));
  }
  return six / 6;
}

/// The corners of the hull; the origin where there is none.
std::vector<Vec3> ProperHull(const std::vector<Vec3>& points) {
  constexpr double kVolumeMin = 1e-15;  // m³
  if (points.size() >= 4) {
    const IndexedHull hull = HullOf(points);
    std::vector<Vec3> corners;
    for (const std::int32_t i : hull.corner) corners.push_back(points[static_cast<std::size_t>(i)]);
    if (std::abs(SignedVolumeOf(corners, hull.triangles)) > kVolumeMin) return corners;
  }
  return {Vec3::Zero()};
}

double Smooth(double t) {
  t = std::clamp(t, 0.0, 1.0);
  return t * t * (3 - 2 * t);
}

}  // namespace

std::vector<MorphPair> MatchCells(const MorphSettings& settings, const TrackedMotion& source, const TrackedMotion& target) {
  const double middle = 0.5 * (settings.start_s + settings.end_s);
  const std::vector<Vec3> from = Comparable(source, middle);
  const std::vector<Vec3> to = Comparable(target, middle + settings.target_start_s);
  const std::vector<double> rank_from = DepthRank(source.model().cells);
  const std::vector<double> rank_to = DepthRank(target.model().cells);
  const std::vector<double> order = OrderOf(settings, rank_from, from);
  const auto cost = [&](std::size_t s, std::size_t t) {
    const double misplaced = settings.order_weight_m * (order[s] - (1 - rank_to[t]));
    return static_cast<float>((from[s] - to[t]).squaredNorm() + misplaced * misplaced);
  };
  const bool source_is_smaller = from.size() <= to.size();
  CostMatrix costs{.rows = std::min(from.size(), to.size()), .columns = std::max(from.size(), to.size())};
  costs.cost.reserve(costs.rows * costs.columns);
  for (std::size_t row = 0; row < costs.rows; ++row) {
    for (std::size_t column = 0; column < costs.columns; ++column) costs.cost.push_back(source_is_smaller ? cost(row, column) : cost(column, row));
  }
  const std::vector<std::int32_t> column_of = OptimalAssignment(costs);

  const double time_to_start = std::max(settings.end_s - settings.start_s - settings.cell_s, 0.0);
  std::vector<MorphPair> pairs;
  std::vector<bool> taken(costs.columns, false);
  for (std::size_t row = 0; row < costs.rows; ++row) {
    MorphPair pair{.source = static_cast<std::int32_t>(row), .target = column_of[row], .at = static_cast<std::int32_t>(row)};
    taken[static_cast<std::size_t>(column_of[row])] = true;
    if (!source_is_smaller) std::swap(pair.source, pair.target);
    pair.start_s = settings.start_s + order[static_cast<std::size_t>(pair.source)] * time_to_start;
    pairs.push_back(pair);
  }
  for (std::size_t column = 0; column < costs.columns; ++column) {
    if (taken[column]) continue;
    std::int32_t nearest = 0;
    double least = std::numeric_limits<double>::infinity();
    for (std::size_t row = 0; row < costs.rows; ++row) {
      const MorphPair& pair = pairs[row];
      const double away = source_is_smaller ? (to[static_cast<std::size_t>(pair.target)] - to[column]).squaredNorm()
                                            : (from[static_cast<std::size_t>(pair.source)] - from[column]).squaredNorm();
      if (away >= least) continue;
      least = away;
      nearest = static_cast<std::int32_t>(row);
    }
    MorphPair pair{.at = nearest, .start_s = pairs[static_cast<std::size_t>(nearest)].start_s};
    (source_is_smaller ? pair.target : pair.source) = static_cast<std::int32_t>(column);
    pairs.push_back(pair);
  }
  return pairs;
}

std::vector<Vec3> ConvexMorph::At(double blend) const {
  std::vector<Vec3> corners;
  for (std::size_t i = 0; i < from.size(); ++i) corners.emplace_back((1 - blend) * from[i] + blend * to[i]);
  return corners;
}

double ConvexMorph::Volume(double blend) const { return SignedVolumeOf(At(blend), triangles); }

ConvexMorph BlendHulls(const std::vector<Vec3>& from, const std::vector<Vec3>& to) {
  const std::vector<Vec3> a = ProperHull(from);
  const std::vector<Vec3> b = ProperHull(to);
  // Which sums are corners does not depend on the blend, as long as it is neither 0 nor 1.
  std::vector<Vec3> sums;
  for (const Vec3& x : a) {
    for (const Vec3& y : b) sums.emplace_back(0.5 * (x + y));
  }
  ConvexMorph morph;
  if (sums.size() < 4) return morph;
  const IndexedHull hull = HullOf(sums);
  for (const std::int32_t i : hull.corner) {
    morph.from.push_back(a[static_cast<std::size_t>(i) / b.size()]);
    morph.to.push_back(b[static_cast<std::size_t>(i) % b.size()]);
  }
  morph.triangles = hull.triangles;
  if (morph.Volume(0.5) < 0) {
    for (Triangle& triangle : morph.triangles) std::swap(triangle[1], triangle[2]);
  }
  return morph;
}

void AddMorph(const MorphSettings& settings, const TrackedMotion& source, const TrackedMotion& target, geometry::SimulatedTake& result) {
  const std::vector<MorphPair> pairs = MatchCells(settings, source, target);
  const Cells& source_cells = source.model().cells;
  const Cells& target_cells = target.model().cells;
  const std::size_t n = source_cells.size();
  geometry::CellMorphs& out = result.morph;
  out.vertex_offset = {0};
  out.triangle_offset = {0};
  std::vector<ConvexMorph> shapes;
  for (const MorphPair& pair : pairs) {
    const std::vector<Vec3> none;
    shapes.push_back(BlendHulls(pair.source < 0 ? none : CornersOf(source_cells, static_cast<std::size_t>(pair.source)),
                                pair.target < 0 ? none : CornersOf(target_cells, static_cast<std::size_t>(pair.target))));
    const ConvexMorph& shape = shapes.back();
    out.source.push_back(pair.source);
    out.target.push_back(pair.target);
    out.from.insert(out.from.end(), shape.from.begin(), shape.from.end());
    out.to.insert(out.to.end(), shape.to.begin(), shape.to.end());
    out.triangles.insert(out.triangles.end(), shape.triangles.begin(), shape.triangles.end());
    out.vertex_offset.push_back(static_cast<std::int64_t>(out.from.size()));
    out.triangle_offset.push_back(static_cast<std::int64_t>(out.triangles.size()));
  }
  std::vector<Rigid3> target_pose;
  for (std::size_t s = 0; s < result.time.size(); ++s) {
    target.Sample(result.time[s] + settings.target_start_s, target_pose);
    for (std::size_t p = 0; p < pairs.size(); ++p) {
      const MorphPair& pair = pairs[p];
      const MorphPair& place = pairs[static_cast<std::size_t>(pair.at)];
      const double blend = Smooth((result.time[s] - pair.start_s) / settings.cell_s);
      const std::size_t from = s * n + static_cast<std::size_t>(pair.source < 0 ? place.source : pair.source);
      const std::size_t to = static_cast<std::size_t>(pair.target < 0 ? place.target : pair.target);
      const Eigen::Vector4f& q = result.cell_rotation[from];
      const Quat rotation = Quat(q[0], q[1], q[2], q[3]).normalized();
      const Vec3 centre = rotation * source_cells.centroid[from - s * n] + result.cell_translation[from];
      const Rigid3 pose = geometry::Interpolate({rotation, centre}, target_pose[to], blend);
      const bool shown = blend > 0 && !(pair.target < 0 && blend >= 1);
      if (blend > 0 && pair.source >= 0) result.cell_state[s * n + static_cast<std::size_t>(pair.source)] = CellState::kGone;
      // A sum of two shapes is larger than either where they differ: its size is set so that the volume goes evenly from one to the other.
      double scale = 1;
      if (shown && !shapes[p].triangles.empty()) {
        const double wanted = (1 - blend) * shapes[p].Volume(0) + blend * shapes[p].Volume(1);
        scale = std::cbrt(std::max(wanted, 0.0) / std::max(shapes[p].Volume(blend), 1e-18));
      }
      out.blend.push_back(shown ? static_cast<float>(blend) : 0);
      out.scale.push_back(static_cast<float>(std::clamp(scale, 0.0, 2.0)));
      out.rotation.push_back(Eigen::Vector4d(pose.rotation.w(), pose.rotation.x(), pose.rotation.y(), pose.rotation.z()).cast<float>().normalized());
      out.translation.push_back(pose.translation.cast<float>());
    }
  }
}

}  // namespace vorocast::simulation
