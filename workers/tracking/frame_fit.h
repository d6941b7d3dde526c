// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <vector>

#include "workers/tracking/normal_equations.h"
#include "workers/tracking/observed_frame.h"
#include "workers/tracking/patch_model.h"
#include "workers/tracking/point_grid.h"
#include "workers/tracking/regulariser.h"

namespace vorocast::tracking {

/// How one iteration associates and weighs.
struct FitStage {
  bool coarse = false;      // associate with the coarse surface samples
  double sigma_m = 0.005;   // of the soft association
  double reach_m = 0.015;   // no partner is looked for beyond this
  double cosine_min = 0.7;  // compatibility of surface points (paper, section 4.3: θmax)
  double depth_tolerance_m = 0.015;
  double regulariser = 0.3;
  std::size_t stride = 1;  // every stride-th surface point is used, beginning at `phase`
  std::size_t inner_stride = 8;
  std::size_t phase = 0;
};

struct FitQuality {
  double residual_m = 0;    // root mean square point-to-plane distance of the surface points with a partner within 2 σ
  double confidence = 0;    // fraction of the surface points with such a partner
  double squared_mean = 0;  // mean squared distance of the surface points to their best partner, at most (2 σ)² each, m²: lower is a better pose
};

/// A fit's quality from what was counted over the surface points: how many there were and how many found a partner, the sum of the squared distances
/// to the best partner (capped), and of the squared point-to-plane distances to those found.
FitQuality QualityOf(std::size_t seen, std::size_t found, double capped, double plane_squared);

/// Fits one frame at a time to a template: soft ICP with one Gauss–Newton step a call (paper, sections 4.1–4.4). Keeps its scratch between calls;
/// results depend on the arguments alone.
class FrameFit {
 public:
  explicit FrameFit(const PatchModel& model);

  /// Associates the frame with the posed template, and moves the pose one step. `reference`: how neighbouring patches should lie to each other.
  void Step(const ObservedFrame& frame, const FitStage& stage, const std::vector<Relation>& reference, Pose& pose);

  /// How well the pose explains the surface points.
  FitQuality Measure(const ObservedFrame& frame, const FitStage& stage, const Pose& pose);

  NormalEquations& equations() { return equations_; }

 private:
  struct Partner {
    float score = 0;  // squared distance, less along the surface than across it
    const PosedPoint* point = nullptr;
  };
  struct Partners {
    int count = 0;
    Partner best[3];  // of different patches, in no order

    void Offer(float score, const PosedPoint& point);
  };

  void PoseSurface(const Pose& pose, const FitStage& stage);
  void PoseInner(const Pose& pose, double cell_m);
  Partners SurfacePartners(const geometry::Vec3f& x, const geometry::Vec3f& normal, const FitStage& stage) const;
  void AssociateSurface(const ObservedFrame& frame, const FitStage& stage);
  void AssociateInner(const ObservedFrame& frame, const FitStage& stage);

  const PatchModel& model_;
  NormalEquations equations_;
  geometry::Vec3 origin_ = geometry::Vec3::Zero();  // of the grids, near the pose
  std::vector<geometry::Vec3f> centre_;             // [patches] posed, relative to origin_
  std::vector<PosedPoint> posed_;
  PointGrid surface_;
  PointGrid inner_;
  std::vector<DataBlock> surface_data_;  // [patches]
  std::vector<DataBlock> inner_data_;
  std::vector<Vector6> twists_;
};

}  // namespace vorocast::tracking
