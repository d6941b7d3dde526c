// SPDX-License-Identifier: AGPL-3.0-or-later
#include "workers/tracking/cell_blending.h"

#include <algorithm>
#include <cmath>

namespace vorocast::tracking {

using geometry::Quat;
using geometry::Rigid3;
using geometry::Vec3;

namespace {

// Width of the weights, in radii of the cell's patch: wide enough to bend smoothly, narrow enough that a joint does not smear.
constexpr double kWidthInRadii = 0.8;
constexpr double kWeightMin = 0.01;

}  // namespace

CellBlending::CellBlending(const geometry::Cells& cells, const std::vector<std::int32_t>& patch, std::int32_t patch_count)
    : centroid_(cells.centroid) {
  const std::vector<Vec3> centre = PatchCentres(cells, patch, patch_count);
  std::vector<std::vector<std::int32_t>> beside(static_cast<std::size_t>(patch_count));
  std::vector<double> spacing(static_cast<std::size_t>(patch_count), 0);  // mean distance to the patches beside
  for (const auto& [k, l] : PatchPairs(cells, patch)) {
    beside[k].push_back(l);
    beside[l].push_back(k);
    spacing[k] += (centre[k] - centre[l]).norm();
    spacing[l] += (centre[k] - centre[l]).norm();
  }
  for (std::size_t k = 0; k < beside.size(); ++k) {
    if (!beside[k].empty()) spacing[k] /= static_cast<double>(beside[k].size());
  }
  offset_.push_back(0);
  for (std::size_t c = 0; c < cells.size(); ++c) {
    const std::int32_t own = patch[c];
    const double width = std::max(kWidthInRadii * spacing[own] / 2, 1e-9);
    const auto weight_of = [&](std::int32_t k) { return std::exp(-(centroid_[c] - centre[k]).squaredNorm() / (2 * width * width)); };
    // Relative to the largest, so that a cell far out in its patch does not underflow.
    const double own_squared = (centroid_[c] - centre[own]).squaredNorm();
    double least = own_squared;
    for (const std::int32_t k : beside[own]) least = std::min(least, (centroid_[c] - centre[k]).squaredNorm());
    const double scale = std::exp(-least / (2 * width * width));
    double total = 0;
    const std::size_t first = shares_.size();
    shares_.push_back({own, scale > 0 ? weight_of(own) / scale : 1.0});
    for (const std::int32_t k : beside[own]) {
      const double weight = scale > 0 ? weight_of(k) / scale : 0;
      if (weight >= kWeightMin) shares_.push_back({k, weight});
    }
    for (std::size_t i = first; i < shares_.size(); ++i) total += shares_[i].weight;
    for (std::size_t i = first; i < shares_.size(); ++i) shares_[i].weight /= total;
    offset_.push_back(static_cast<std::int32_t>(shares_.size()));
  }
}

Rigid3 CellBlending::Blend(std::size_t cell, const Rigid3* patch_pose) const {
  const Vec3& centroid = centroid_[cell];
  const Quat& own = patch_pose[shares_[offset_[cell]].patch].rotation;
  Eigen::Vector4d rotation = Eigen::Vector4d::Zero();
  Vec3 posed = Vec3::Zero();
  for (std::int32_t i = offset_[cell]; i < offset_[cell + 1]; ++i) {
    const Rigid3& pose = patch_pose[shares_[i].patch];
    // q and −q are one rotation: all are taken on the own patch's side.
    const double side = own.dot(pose.rotation) < 0 ? -1.0 : 1.0;
    rotation += shares_[i].weight * side * pose.rotation.coeffs();
    posed += shares_[i].weight * (pose * centroid);
  }
  const Quat blended = Quat(rotation).normalized();
  return {blended, posed - blended * centroid};
}

AffineNode CellBlending::Blend(std::size_t cell, const std::vector<Vec3>& centre, const Deformation& nodes) const {
  AffineNode blended{Vec3::Zero(), geometry::Mat3::Zero()};
  for (std::int32_t i = offset_[cell]; i < offset_[cell + 1]; ++i) {
    const auto& [node, weight] = shares_[i];
    blended.position += weight * (nodes[node].position + nodes[node].gradient * (centroid_[cell] - centre[node]));
    blended.gradient += weight * nodes[node].gradient;
  }
  return blended;
}

}  // namespace vorocast::tracking
