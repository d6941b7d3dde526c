// SPDX-License-Identifier: AGPL-3.0-or-later
#include "workers/tracking/fine_model.h"

#include <algorithm>

#include "workers/tracking/tracking.h"

namespace vorocast::tracking {
namespace {

using geometry::Mat3;
using geometry::Quat;
using geometry::Rigid3;
using geometry::Vec3;

constexpr std::int32_t kCellsOfANode = 5;
constexpr std::uint64_t kSeed = 7;

std::vector<std::int32_t> NodesOf(const geometry::Template& model) {
  const auto cells = static_cast<std::int32_t>(model.cells.size());
  const std::int32_t count = std::clamp(cells / kCellsOfANode, std::min(model.patch_count, cells), cells);
  return ClusterPatches(model.cells, count, kSeed).value();
}

/// Sums over pairs of points and the frames around them, for the affine or rigid map from one set to the other. A point counts with an extent of its
/// own, so that even one alone says how it is turned.
class Correspondence {
 public:
  explicit Correspondence(double extent_squared) : extent_squared_(extent_squared) {}

  void Add(const Vec3& from, const Vec3& to, const Mat3& rotation) {
    count_ += 1;
    from_ += from;
    to_ += to;
    from_from_ += from * from.transpose() + extent_squared_ * Mat3::Identity();
    to_from_ += to * from.transpose() + extent_squared_ * rotation;
  }
  Vec3 from() const { return from_ / count_; }
  Vec3 to() const { return to_ / count_; }
  /// Σ (to − mean)(from − mean)ᵀ, and the same of `from` alone.
  Mat3 Cross() const { return to_from_ - to_ * from_.transpose() / count_; }
  Mat3 Own() const { return from_from_ - from_ * from_.transpose() / count_; }

 private:
  double extent_squared_;
  double count_ = 0;
  Vec3 from_ = Vec3::Zero();
  Vec3 to_ = Vec3::Zero();
  Mat3 from_from_ = Mat3::Zero();
  Mat3 to_from_ = Mat3::Zero();
};

/// A compact cell's own second moment, about.
double ExtentSquared(double cell_spacing_m) { return 0.06 * cell_spacing_m * cell_spacing_m; }

}  // namespace

FineModel::FineModel(const geometry::Template& model)
    : model_(model),
      node_(NodesOf(model)),
      nodes_(BuildPatchModel(model.cells, node_, 1 + *std::ranges::max_element(node_))),
      patch_blending_(model.cells, model.patch, model.patch_count),
      node_blending_(model.cells, node_, nodes_.patch_count),
      surface_arm_(model.cells.size(), Vec3::Zero()) {
  std::vector<double> count(model.cells.size(), 0);
  for (const SurfaceSample& sample : nodes_.surface) {
    surface_arm_[sample.cell] += sample.position - model.cells.centroid[sample.cell];
    ++count[sample.cell];
  }
  for (std::size_t c = 0; c < count.size(); ++c) surface_arm_[c] /= std::max(count[c], 1.0);
}

Deformation FineModel::FromPatches(const Rigid3* patch_pose) const {
  const std::vector<Vec3>& centroid = model_.cells.centroid;
  // Sums are taken about where the body is, or they would lose digits far from the origin.
  const Vec3 here = centroid[0];
  const Vec3 there = patch_pose[0] * here;
  std::vector<Correspondence> cells(static_cast<std::size_t>(nodes_.patch_count), Correspondence(ExtentSquared(nodes_.cell_spacing_m)));
  for (std::size_t c = 0; c < centroid.size(); ++c) {
    const Rigid3 pose = patch_blending_.Blend(c, patch_pose);
    cells[node_[c]].Add(centroid[c] - here, pose * centroid[c] - there, pose.rotation.toRotationMatrix());
  }
  Deformation deformation(cells.size());
  for (std::size_t k = 0; k < cells.size(); ++k) {
    const Mat3 gradient = cells[k].Cross() * cells[k].Own().inverse();
    deformation[k] = {there + cells[k].to() + gradient * (nodes_.centre[k] - here - cells[k].from()), gradient};
  }
  return deformation;
}

std::vector<Rigid3> FineModel::CellPoses(const Deformation& deformation) const {
  std::vector<Rigid3> poses;
  poses.reserve(model_.cells.size());
  for (std::size_t c = 0; c < model_.cells.size(); ++c) {
    const AffineNode cell = node_blending_.Blend(c, nodes_.centre, deformation);
    const Mat3 rotation = NearestRotation(cell.gradient);
    // A rigid cell cannot have both its middle and its surface where a stretched one would: the surface is what is seen.
    const Vec3 position = cell.position + (cell.gradient - rotation) * surface_arm_[c];
    const Quat turn = Quat(rotation).normalized();
    poses.push_back({turn, position - turn * model_.cells.centroid[c]});
  }
  return poses;
}

Pose FineModel::PatchPoses(const std::vector<Rigid3>& cell_pose) const {
  const std::vector<Vec3>& centroid = model_.cells.centroid;
  const Vec3 here = centroid[0];
  const Vec3 there = cell_pose[0] * here;
  std::vector<Correspondence> cells(static_cast<std::size_t>(model_.patch_count), Correspondence(ExtentSquared(nodes_.cell_spacing_m)));
  for (std::size_t c = 0; c < centroid.size(); ++c) {
    cells[model_.patch[c]].Add(centroid[c] - here, cell_pose[c] * centroid[c] - there, cell_pose[c].rotation.toRotationMatrix());
  }
  Pose pose;
  for (const Correspondence& patch : cells) {
    const Mat3 cross = patch.Cross();
    const Quat rotation = Quat(NearestRotation(cross / (patch.Own().trace() / 3))).normalized();
    pose.push_back({rotation, there + patch.to() - rotation * Vec3(here + patch.from())});
  }
  return pose;
}

}  // namespace vorocast::tracking
