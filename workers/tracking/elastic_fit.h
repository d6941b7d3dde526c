// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <vector>

#include "workers/tracking/frame_fit.h"
#include "workers/tracking/observed_frame.h"
#include "workers/tracking/patch_model.h"
#include "workers/tracking/point_grid.h"

namespace vorocast::tracking {

/// The map of one node, a patch or a part of one: the template's point x goes to position + gradient · (x − centre). Not rigid: skin and cloth
/// stretch by a tenth or two around every joint, and a body of rigid parts answers by sliding along the surface.
struct AffineNode {
  geometry::Vec3 position = geometry::Vec3::Zero();
  geometry::Mat3 gradient = geometry::Mat3::Identity();
};

/// One map a node of a PatchModel.
using Deformation = std::vector<AffineNode>;

/// Every node moved as its rigid pose says.
Deformation DeformationOf(const PatchModel& model, const Pose& pose);
/// The rigid poses nearest to the maps, over the cells of each node.
Pose PoseOf(const PatchModel& model, const Deformation& deformation);
/// The rotation nearest to a matrix with a positive determinant; to any other, the one that the singular vectors give.
geometry::Mat3 NearestRotation(const geometry::Mat3& matrix);

/// How one iteration associates and weighs.
struct ElasticStage {
  double sigma_m = 0.005;   // an observed point this far from the surface counts e^−½
  double reach_m = 0.010;   // no partner is looked for beyond this
  double cosine_min = 0.7;  // compatibility of surface points (paper, section 4.3: θmax)
  double depth_tolerance_m = 0.015;
  double regulariser = 0.3;
  std::size_t stride = 1;  // every stride-th surface point is used, beginning at `phase`
  std::size_t inner_stride = 8;
  std::size_t phase = 0;
};

/// Fits affine nodes to one frame: point-to-plane distances with a single best partner, and a regulariser that lets neighbouring nodes deform alike
/// for nothing and costs where they deform differently, seen from a known deformation. A constant stretch is free, so that the relief of the surface
/// (wrinkles, limbs that are not round) can say where the surface is along itself. One Gauss–Newton step a call, solved by conjugate gradients.
/// Keeps its scratch between calls; results depend on the arguments alone.
class ElasticFit {
 public:
  explicit ElasticFit(const PatchModel& model);

  /// Moves `now` one step. `before`: the deformation that is regular; its changes are what is held smooth.
  void Step(const ObservedFrame& frame, const ElasticStage& stage, const Deformation& before, Deformation& now);

  /// `iterations` steps; every second one, what has been reached becomes regular.
  void Run(const ObservedFrame& frame, const std::vector<ElasticStage>& stages, Deformation& now);

  /// How well the deformation explains the surface points.
  FitQuality Measure(const ObservedFrame& frame, const ElasticStage& stage, const Deformation& deformation);

 private:
  using Vector12 = Eigen::Matrix<double, 12, 1>;  // node unknowns: position, then the gradient's columns
  using Matrix12 = Eigen::Matrix<double, 12, 12>;
  using Columns = Eigen::Matrix<double, 3, 4>;

  struct Partner {
    const PosedPoint* point = nullptr;  // its `patch` is the index of the sample
    float score = 0;
  };
  /// A node's data terms: Σ w (ã ãᵀ) ⊗ (n nᵀ) as the upper triangles' outer product, ã = (1, a).
  struct NodeData {
    Eigen::Matrix<double, 6, 10> square;
    Columns gradient;
  };
  struct EdgeArms {
    geometry::Vec3 from_k;  // where l's centre should lie from k's, as k sees it
    geometry::Vec3 from_l;  // as l sees it
    double weight = 0;
    double turn_weight = 0;
  };

  void PoseSurface(const Deformation& now, const ElasticStage& stage);
  Partner SurfacePartner(const geometry::Vec3f& x, const geometry::Vec3f& normal, const ElasticStage& stage) const;
  void AddSurface(const ObservedFrame& frame, const ElasticStage& stage, const Deformation& before);
  void AddInner(const ObservedFrame& frame, const ElasticStage& stage, const Deformation& before, const Deformation& now);
  void AddRegulariser(const Deformation& before, const Deformation& now, double weight);
  void ExpandData();
  void Apply(const std::vector<Vector12>& z, std::vector<Vector12>& out) const;
  void Solve();

  const PatchModel& model_;
  geometry::Vec3 origin_ = geometry::Vec3::Zero();  // of the grids, near the body
  std::vector<PosedPoint> posed_;
  PointGrid surface_;
  PointGrid inner_;
  std::vector<NodeData> data_;                  // [nodes]
  std::vector<geometry::Mat3> change_;          // [nodes] gradient now · (gradient before)⁻¹: the unknown
  std::vector<geometry::Mat3> before_inverse_;  // [nodes]
  std::vector<EdgeArms> arms_;                  // [edges]
  std::vector<Matrix12> diagonal_;
  std::vector<Matrix12> inverse_;  // of the diagonal blocks: the preconditioner
  std::vector<Vector12> gradient_;
  std::vector<Vector12> step_, residual_, preconditioned_, direction_, product_;
};

}  // namespace vorocast::tracking
