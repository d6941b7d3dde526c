// SPDX-License-Identifier: AGPL-3.0-or-later
#include "workers/tracking/patch_model.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include "workers/tracking/surface_samples.h"

namespace vorocast::tracking {
namespace {

using geometry::Mat3;
using geometry::Vec3;

constexpr double kFineSpacingM = 0.012;
constexpr double kCoarseSpacingM = 0.020;

/// Mass and second moment of a patch about its centre.
struct PatchMoments {
  double mass = 0;
  Mat3 covariance = Mat3::Zero();
};

std::vector<PatchMoments> MomentsOfPatches(const geometry::Cells& cells, const std::vector<std::int32_t>& patch, const std::vector<Vec3>& centre) {
  const double total = std::accumulate(cells.volume.begin(), cells.volume.end(), 0.0);
  const double mean_volume = total > 0 ? total / static_cast<double>(cells.size()) : 1;
  std::vector<PatchMoments> moments(centre.size());
  for (std::size_t c = 0; c < cells.size(); ++c) {
    PatchMoments& m = moments[patch[c]];
    const double mass = cells.volume[c] / mean_volume;
    const Vec3 arm = cells.centroid[c] - centre[patch[c]];
    // A compact cell's own second moment: 0.08 V^(2/3) along each axis (0.0785 for the best lattice).
    m.covariance += mass * (arm * arm.transpose() + 0.08 * std::pow(cells.volume[c], 2.0 / 3.0) * Mat3::Identity());
    m.mass += mass;
  }
  return moments;
}

/// Adds the edge (k, l) with its cells counted `share` times.
void AddEdge(std::int32_t k, std::int32_t l, double share, const std::vector<PatchMoments>& moments, PatchModel& model) {
  PatchEdge edge{k, l, share, moments[k].mass + moments[l].mass, Vec3::Zero(), Mat3::Zero()};
  edge.mean = (moments[k].mass * model.centre[k] + moments[l].mass * model.centre[l]) / edge.mass;
  for (const std::int32_t side : {k, l}) {
    const Vec3 arm = model.centre[side] - edge.mean;
    edge.covariance += moments[side].covariance + moments[side].mass * arm * arm.transpose();
  }
  edge.mass *= share;
  edge.covariance *= share;
  model.edge_mass += edge.mass;
  model.edges.push_back(edge);
}

/// Labels patches that edges connect, directly or not, with the lowest patch among them.
std::vector<std::int32_t> ConnectedPatches(const PatchModel& model) {
  std::vector<std::int32_t> label(static_cast<std::size_t>(model.patch_count));
  std::iota(label.begin(), label.end(), 0);
  for (bool changed = true; changed;) {
    changed = false;
    for (const PatchEdge& edge : model.edges) {
      const std::int32_t lowest = std::min(label[edge.k], label[edge.l]);
      changed |= label[edge.k] != label[edge.l];
      label[edge.k] = label[edge.l] = lowest;
    }
  }
  return label;
}

/// Ties each group of connected patches weakly to the nearest patch of another: a fragment that no point tells of then goes with what is beside it
/// instead of anywhere, while a component that is seen hardly feels it.
void AddTethers(const std::vector<PatchMoments>& moments, PatchModel& model) {
  constexpr double kShare = 0.01;
  const std::vector<std::int32_t> label = ConnectedPatches(model);
  std::vector<std::array<std::int32_t, 2>> tethers;
  for (std::int32_t group = 0; group < model.patch_count; ++group) {
    std::array<std::int32_t, 2> nearest{-1, -1};
    double least = std::numeric_limits<double>::infinity();
    for (std::int32_t k = group; k < model.patch_count && label[group] == group; ++k) {
      if (label[k] != group) continue;
      for (std::int32_t l = 0; l < model.patch_count; ++l) {
        const double squared = (model.centre[k] - model.centre[l]).squaredNorm();
        if (label[l] != group && squared < least) least = squared, nearest = {std::min(k, l), std::max(k, l)};
      }
    }
    if (nearest[0] >= 0) tethers.push_back(nearest);
  }
  std::ranges::sort(tethers);
  const auto repeated = std::ranges::unique(tethers);
  tethers.erase(repeated.begin(), repeated.end());
  for (const auto& [k, l] : tethers) AddEdge(k, l, kShare, moments, model);
}

}  // namespace

std::vector<std::array<std::int32_t, 2>> PatchPairs(const geometry::Cells& cells, const std::vector<std::int32_t>& patch) {
  std::vector<std::array<std::int32_t, 2>> pairs;
  for (const auto& [a, b] : geometry::NeighbourPairs(cells)) {
    if (!cells.component.empty() && cells.component[a] != cells.component[b]) continue;
    if (patch[a] != patch[b]) pairs.push_back({std::min(patch[a], patch[b]), std::max(patch[a], patch[b])});
  }
  std::ranges::sort(pairs);
  const auto repeated = std::ranges::unique(pairs);
  pairs.erase(repeated.begin(), repeated.end());
  return pairs;
}

std::vector<Vec3> PatchCentres(const geometry::Cells& cells, const std::vector<std::int32_t>& patch, std::int32_t patch_count) {
  std::vector<Vec3> centre(static_cast<std::size_t>(patch_count), Vec3::Zero());
  std::vector<double> mass(static_cast<std::size_t>(patch_count), 0);
  for (std::size_t c = 0; c < cells.size(); ++c) {
    centre[patch[c]] += cells.volume[c] * cells.centroid[c];
    mass[patch[c]] += cells.volume[c];
  }
  for (std::size_t k = 0; k < centre.size(); ++k) {
    if (mass[k] > 0) centre[k] /= mass[k];
  }
  return centre;
}

PatchModel BuildPatchModel(const geometry::Cells& cells, const std::vector<std::int32_t>& patch, std::int32_t patch_count) {
  PatchModel model;
  model.patch_count = patch_count;
  model.centre = PatchCentres(cells, patch, patch_count);
  const std::vector<PatchMoments> moments = MomentsOfPatches(cells, patch, model.centre);
  for (const PatchMoments& m : moments) model.covariance.push_back(m.covariance);
  for (const auto& [k, l] : PatchPairs(cells, patch)) AddEdge(k, l, 1, moments, model);
  AddTethers(moments, model);
  model.surface = SampleTemplateSurface(cells, patch, kFineSpacingM);
  model.surface_coarse = SampleTemplateSurface(cells, patch, kCoarseSpacingM);
  for (std::size_t c = 0; c < cells.size(); ++c) model.inner.push_back({cells.centroid[c], cells.depth[c], patch[c]});
  const double volume = std::accumulate(cells.volume.begin(), cells.volume.end(), 0.0);
  // Neighbours in the densest lattice of this cell volume are 1.12 V^(1/3) apart.
  model.cell_spacing_m = 1.12 * std::cbrt(volume / static_cast<double>(cells.size()));
  return model;
}

absl::Status ValidateTemplate(const geometry::Template& model) {
  const std::size_t n = model.cells.size();
  if (n == 0) return absl::InvalidArgumentError("template: it has no cells");
  if (model.patch.size() != n || model.cells.volume.size() != n || model.cells.centroid.size() != n || model.cells.depth.size() != n ||
      model.cells.face_offset.size() != n + 1 || (!model.cells.component.empty() && model.cells.component.size() != n)) {
    return absl::InvalidArgumentError(fmt::format("template: its arrays do not all have one entry for each of its {} cells", n));
  }
  std::vector<std::int32_t> cells_of_patch(static_cast<std::size_t>(std::max(model.patch_count, 0)), 0);
  for (std::size_t c = 0; c < n; ++c) {
    if (model.patch[c] < 0 || model.patch[c] >= model.patch_count) {
      return absl::InvalidArgumentError(
          fmt::format("template: cell {} is in patch {}, but there are {} patches", c, model.patch[c], model.patch_count));
    }
    if (!(model.cells.volume[c] > 0)) return absl::InvalidArgumentError(fmt::format("template: cell {} has no volume", c));
    ++cells_of_patch[model.patch[c]];
  }
  const auto empty = std::ranges::find(cells_of_patch, 0);
  if (empty != cells_of_patch.end()) {
    return absl::InvalidArgumentError(fmt::format("template: patch {} has no cells", empty - cells_of_patch.begin()));
  }
  return absl::OkStatus();
}

}  // namespace vorocast::tracking
