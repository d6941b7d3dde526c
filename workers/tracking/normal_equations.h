// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <cstdint>
#include <vector>

#include "workers/tracking/block_cholesky.h"
#include "workers/tracking/patch_model.h"

// Gauss–Newton on SE(3), one twist a patch. Legend:
//   ξ = (ω, v)  twist of a patch: a posed point p moves to p + ω × a + v, to first order
//   c           the patch's posed centre; twists turn about it, so that ω and v hardly couple
//   a = p − c   arm of a posed point
//   r           residual; H = Σ w Jᵀ J, g = Σ w Jᵀ r, energy Σ w r², step ξ = −H⁻¹ g

namespace vorocast::tracking {

inline geometry::Mat3 Cross(const geometry::Vec3& a) {
  geometry::Mat3 m;
  m << 0, -a.z(), a.y(), a.z(), 0, -a.x(), -a.y(), a.x(), 0;
  return m;
}

/// A patch's share of the normal equations from data, gathered as moments: point-to-plane terms as a 6×6 matrix, point-to-point ones as sums over
/// arms.
class DataBlock {
 public:
  DataBlock() { Clear(); }
  void Clear();
  /// Adds weight · (normal · delta)² with delta = p − observation.
  void AddPointToPlane(const geometry::Vec3& arm, const geometry::Vec3& normal, const geometry::Vec3& delta, double weight);
  /// Adds weight · |delta|².
  void AddPointToPoint(const geometry::Vec3& arm, const geometry::Vec3& delta, double weight);
  /// Adds scale times this block to H and g.
  void AddTo(Matrix6& h, Vector6& g, double scale) const;
  double energy() const { return energy_; }
  double weight() const { return weight_; }

 private:
  Matrix6 plane_h_;  // lower triangle
  Vector6 gradient_;
  double weight_ = 0;
  double point_weight_ = 0;
  geometry::Vec3 arm_sum_;
  geometry::Mat3 arm_square_;
  double energy_ = 0;
};

/// The block-sparse system over all patches: a diagonal block a patch and one below the diagonal for each edge. The pattern is analysed once.
class NormalEquations {
 public:
  explicit NormalEquations(const PatchModel& model);

  void Clear();
  Matrix6& Diagonal(std::int32_t k) { return diagonal_[k]; }
  /// The block of rows l and columns k of edge (k, l).
  Matrix6& Lower(std::size_t edge) { return lower_[edge]; }
  Vector6& Gradient(std::int32_t k) { return gradient_[k]; }

  /// Solves (H + damping · trace-scaled identity) ξ = −g. False when the factorisation fails; the twists are then zero.
  bool Solve(double damping, std::vector<Vector6>& twists);

 private:
  const PatchModel& model_;
  std::vector<Matrix6> diagonal_;
  std::vector<Matrix6> lower_;
  std::vector<Vector6> gradient_;
  BlockCholesky cholesky_;
};

/// Moves each patch by its twist, about its posed centre; rotations stay unit.
void ApplyTwists(const PatchModel& model, const std::vector<Vector6>& twists, Pose& pose);

}  // namespace vorocast::tracking
