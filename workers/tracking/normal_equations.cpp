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

NormalEquations::NormalEquations(const PatchModel& model)
    : model_(model),
      diagonal_(static_cast<std::size_t>(model.patch_count)),
      lower_(model.edges.size()),
      gradient_(static_cast<std::size_t>(model.patch_count)) {
  const int size = 6 * model.patch_count;
  std::vector<Eigen::Triplet<double>> entries;
  for (std::int32_t k = 0; k < model.patch_count; ++k) {
    for (int j = 0; j < 6; ++j) {
      for (int i = j; i < 6; ++i) entries.emplace_back(6 * k + i, 6 * k + j, i == j ? 1.0 : 0.0);
    }
  }
  for (const PatchEdge& edge : model.edges) {
    for (int j = 0; j < 6; ++j) {
      for (int i = 0; i < 6; ++i) entries.emplace_back(6 * edge.l + i, 6 * edge.k + j, 0.0);
    }
  }
  matrix_.resize(size, size);
  matrix_.setFromTriplets(entries.begin(), entries.end());
  matrix_.makeCompressed();
  const auto find = [&](int row, int column) {
    const int* begin = matrix_.innerIndexPtr() + matrix_.outerIndexPtr()[column];
    const int* end = matrix_.innerIndexPtr() + matrix_.outerIndexPtr()[column + 1];
    return static_cast<std::int32_t>(std::lower_bound(begin, end, row) - matrix_.innerIndexPtr());
  };
  for (std::int32_t k = 0; k < model.patch_count; ++k) {
    value_of_diagonal_.emplace_back();
    for (int j = 0; j < 6; ++j) value_of_diagonal_.back().push_back(find(6 * k + j, 6 * k + j));
  }
  for (const PatchEdge& edge : model.edges) {
    value_of_lower_.emplace_back();
    for (int j = 0; j < 6; ++j) value_of_lower_.back().push_back(find(6 * edge.l, 6 * edge.k + j));
  }
  cholesky_.analyzePattern(matrix_);
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
  double* values = matrix_.valuePtr();
  for (std::int32_t k = 0; k < model_.patch_count; ++k) {
    for (int j = 0; j < 6; ++j) {
      double* column = values + value_of_diagonal_[k][j];
      for (int i = j; i < 6; ++i) column[i - j] = diagonal_[k](i, j);
      column[0] += damping * (j < 3 ? turn : move);
    }
  }
  for (std::size_t e = 0; e < lower_.size(); ++e) {
    for (int j = 0; j < 6; ++j) {
      double* column = values + value_of_lower_[e][j];
      for (int i = 0; i < 6; ++i) column[i] = lower_[e](i, j);
    }
  }
  twists.assign(static_cast<std::size_t>(model_.patch_count), Vector6::Zero());
  cholesky_.factorize(matrix_);
  if (cholesky_.info() != Eigen::Success) return false;
  Eigen::VectorXd right(6 * model_.patch_count);
  for (std::int32_t k = 0; k < model_.patch_count; ++k) right.segment<6>(6 * k) = -gradient_[k];
  const Eigen::VectorXd solution = cholesky_.solve(right);
  if (!solution.allFinite()) return false;
  for (std::int32_t k = 0; k < model_.patch_count; ++k) twists[k] = solution.segment<6>(6 * k);
  return true;
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
