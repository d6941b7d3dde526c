// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "services/base/status.h"
#include "services/geometry/tracked_take.h"

namespace vorocast::tracking {

/// The pose of a template: one world_from_template a patch.
using Pose = std::vector<geometry::Rigid3>;

/// A point on the template's surface, where observed surface points may be associated.
struct SurfaceSample {
  geometry::Vec3 position;
  geometry::Vec3 normal;  // outward, unit, averaged over the vicinity
  std::int32_t patch = 0;
  std::int32_t cell = 0;
};

/// A cell's centroid, where observed inner points may be associated.
struct InnerSample {
  geometry::Vec3 position;
  double depth = 0;  // distance to the surface, metres
  std::int32_t patch = 0;
};

/// Two neighbouring patches k < l, and the moments of the cells in k ∪ l that the pose distance D_kl needs (paper, section 4.4).
struct PatchEdge {
  std::int32_t k = 0;
  std::int32_t l = 0;
  double share = 1;           // less for a tether between what is not connected; mass and covariance are scaled by it
  double mass = 0;            // volume, in units of the mean cell volume
  geometry::Vec3 mean;        // centroid of k ∪ l
  geometry::Mat3 covariance;  // Σ mass (x − mean)(x − mean)ᵀ, the cells' own extent included, so that even a lone cell resists rotation
};

/// A template made ready for tracking: what does not change from frame to frame.
struct PatchModel {
  std::int32_t patch_count = 0;
  std::vector<geometry::Vec3> centre;         // [patches] centroid of each patch
  std::vector<geometry::Mat3> covariance;     // [patches] Σ mass (x − centre)(x − centre)ᵀ, the cells' own extent included
  std::vector<PatchEdge> edges;               // sorted by (k, l); then weak ones that tie what is not connected
  double edge_mass = 0;                       // Σ mass over the edges
  std::vector<SurfaceSample> surface;         // 12 mm apart
  std::vector<SurfaceSample> surface_coarse;  // 20 mm apart, for wide associations: a quarter of the candidates
  std::vector<InnerSample> inner;             // [n] one a cell
  double cell_spacing_m = 0;                  // distance between neighbouring centroids, about
};

PatchModel BuildPatchModel(const geometry::Cells& cells, const std::vector<std::int32_t>& patch, std::int32_t patch_count);

/// Pairs (k < l) of patches that share a face between cells of one component, sorted, each once.
std::vector<std::array<std::int32_t, 2>> PatchPairs(const geometry::Cells& cells, const std::vector<std::int32_t>& patch);

/// Volume-weighted centroid of each patch.
std::vector<geometry::Vec3> PatchCentres(const geometry::Cells& cells, const std::vector<std::int32_t>& patch, std::int32_t patch_count);

/// INVALID_ARGUMENT unless the template's arrays fit each other and every patch has a cell.
absl::Status ValidateTemplate(const geometry::Template& model);

}  // namespace vorocast::tracking
