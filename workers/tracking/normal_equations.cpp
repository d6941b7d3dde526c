// SPDX-License-Identifier: AGPL-3.0-or-later
#include "workers/tracking/normal_equations.h"

#include <algorithm>

namespace vorocast::tracking {

using geometry::Mat3;
using geometry::Quat;
using geometry::Vec3;

void DataBlock::Clear() {
  plane_h_.setZero();
  gradient_.setZero();
  weight_ = 0;
  point_weight_ = 0;
  arm_sum_.setZero();
  arm_square_.setZero();
  energy_ = 0;
}

void DataBlock::AddPointToPlane(const Vec3& arm, const Vec3& normal, const Vec3& delta, double weight) {
  Vector6 row;
  row << arm.cross(normal), normal;
  const double residual = normal.dot(delta);
  const Vector6 weighted = weight * row;
  for (int j = 0; j < 6; ++j) {
    for (int i = j; i < 6; ++i) plane_h_(i, j) += weighted[j] * row[i];
  }
  gradient_ += residual * weighted;
  weight_ += weight;
  energy_ += weight * residual * residual;
}

void DataBlock::AddPointToPoint(const Vec3& arm, const Vec3& delta, double weight) {
  gradient_.head<3>() += weight * arm.cross(delta);
  gradient_.tail<3>() += weight * delta;
  arm_sum_ += weight * arm;
  arm_square_ += weight * arm * arm.transpose();
  point_weight_ += weight;
  weight_ += weight;
  energy_ += weight * delta.squaredNorm();
}

void DataBlock::AddTo(Matrix6& h, Vector6& g, double scale) const {
  h += scale * Matrix6(plane_h_.selfadjointView<Eigen::Lower>());
  h.topLeftCorner<3, 3>() += scale * (arm_square_.trace() * Mat3::Identity() - arm_square_);
  h.topRightCorner<3, 3>() += scale * Cross(arm_sum_);
  h.bottomLeftCorner<3, 3>() += scale * Cross(arm_sum_).transpose();
  h.bottomRightCorner<3, 3>() += scale * point_weight_ * Mat3::Identity();
  g += scale * gradient_;
}

namespace {

std::vector<std::array<std::int32_t, 2>> PairsOf(const std::vector<PatchEdge>& edges) {
  std::vector<std::array<std::int32_t, 2>> pairs;
  for (const PatchEdge& edge : edges) pairs.push_back({edge.k, edge.l});
  return pairs;
}

}  // namespace

NormalEquations::NormalEquations(const PatchModel& model)
    : model_(model),
      diagonal_(static_cast<std::size_t>(model.patch_count)),
      lower_(model.edges.size()),
      gradient_(static_cast<std::size_t>(model.patch_count)),
      cholesky_(model.patch_count, PairsOf(model.edges)) {
  Clear();
}

void NormalEquations::Clear() {
  for (Matrix6& block : diagonal_) block.setZero();
  for (Matrix6& block : lower_) block.setZero();
  for (Vector6& g : gradient_) g.setZero();
}

bool NormalEquations::Solve(double damping, std::vector<Vector6>& twists) {
  Vector6 scale = Vector6::Zero();
  for (const Matrix6& block : diagonal_) scale += block.diagonal();
  // Turning and moving have different units, so each has its own scale; the floor keeps a system without any data or edges regular.
  const double turn = std::max(scale.head<3>().sum() / (3.0 * model_.patch_count), 1e-12);
  const double move = std::max(scale.tail<3>().sum() / (3.0 * model_.patch_count), 1e-9);
  cholesky_.Clear();
  twists.resize(static_cast<std::size_t>(model_.patch_count));
  for (std::int32_t k = 0; k < model_.patch_count; ++k) {
    Matrix6& block = cholesky_.Diagonal(k);
    block = diagonal_[k];
    for (int i = 0; i < 6; ++i) block(i, i) += damping * (i < 3 ? turn : move);
    twists[k] = -gradient_[k];
  }
  for (std::size_t e = 0; e < lower_.size(); ++e) cholesky_.SetLower(e, lower_[e]);
  bool solved = cholesky_.Factorise();
  if (solved) cholesky_.Solve(twists);
  for (const Vector6& twist : twists) solved = solved && twist.allFinite();
  if (!solved) std::ranges::fill(twists, Vector6::Zero());
  return solved;
}

void ApplyTwists(const PatchModel& model, const std::vector<Vector6>& twists, Pose& pose) {
  for (std::int32_t k = 0; k < model.patch_count; ++k) {
    const Vec3 centre = pose[k] * model.centre[k];
    Vec3 omega = twists[k].head<3>();
    // Beyond half a radian the linearisation says nothing; the next iteration takes the rest.
    const double angle = omega.norm();
    if (angle > 0.5) omega *= 0.5 / angle;
    const Quat turn = angle > 0 ? Quat(Eigen::AngleAxisd(omega.norm(), omega.normalized())) : Quat::Identity();
    pose[k].rotation = (turn * pose[k].rotation).normalized();
    pose[k].translation = centre + twists[k].tail<3>() - pose[k].rotation * model.centre[k];
  }
}

}  // namespace vorocast::tracking
