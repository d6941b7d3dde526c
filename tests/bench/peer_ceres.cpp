// SPDX-License-Identifier: AGPL-3.0-or-later
#include "tests/bench/peer_ceres.h"

#include <ceres/ceres.h>

#include <Eigen/Eigenvalues>
#include <array>
#include <cmath>

namespace vorocast::bench {
namespace {

using geometry::Mat3;
using geometry::Vec3;

template <typename T>
using Vec3Of = Eigen::Matrix<T, 3, 1>;

template <typename T>
Vec3Of<T> Turn(const T* rotation, const Vec3Of<T>& x) {
  return Eigen::Map<const Eigen::Quaternion<T>>(rotation) * x;
}

template <typename T>
Vec3Of<T> Move(const T* rotation, const T* translation, const Vec3Of<T>& x) {
  return Turn(rotation, x) + Eigen::Map<const Vec3Of<T>>(translation);
}

struct PlaneCost {
  PlaneTerm term;

  template <typename T>
  bool operator()(const T* rotation, const T* translation, T* residual) const {
    const Vec3Of<T> posed = Move(rotation, translation, Vec3Of<T>(term.template_point.cast<T>()));
    *residual = term.normal.cast<T>().dot(posed - term.observed.cast<T>());
    return true;
  }
};

/// D of an edge by its moments: the mean of both patches' cells, and the principal axes of their covariance.
struct EdgeCost {
  double weight;  // square root of the mass
  Vec3 mean, mean_in_l;
  std::array<Vec3, 3> axis, axis_in_l;  // times the square root of their moment

  template <typename T>
  bool operator()(const T* rotation_k, const T* translation_k, const T* rotation_l, const T* translation_l, T* residual) const {
    Eigen::Map<Vec3Of<T>> of_mean(residual);
    of_mean =
        T(weight) * (Move(rotation_k, translation_k, Vec3Of<T>(mean.cast<T>())) - Move(rotation_l, translation_l, Vec3Of<T>(mean_in_l.cast<T>())));
    for (std::size_t i = 0; i < 3; ++i) {
      Eigen::Map<Vec3Of<T>> of_axis(residual + 3 * (i + 1));
      of_axis = Turn(rotation_k, Vec3Of<T>(axis[i].cast<T>())) - Turn(rotation_l, Vec3Of<T>(axis_in_l[i].cast<T>()));
    }
    return true;
  }
};

EdgeCost CostOf(const tracking::PatchEdge& edge, const tracking::Relation& reference, double regulariser) {
  EdgeCost cost{std::sqrt(regulariser * edge.mass), edge.mean, reference.matrix * edge.mean + reference.offset, {}, {}};
  const Eigen::SelfAdjointEigenSolver<Mat3> principal(edge.covariance);
  for (Eigen::Index i = 0; i < 3; ++i) {
    const Vec3 axis = std::sqrt(regulariser * std::max(principal.eigenvalues()[i], 0.0)) * principal.eigenvectors().col(i);
    cost.axis[static_cast<std::size_t>(i)] = axis;
    cost.axis_in_l[static_cast<std::size_t>(i)] = reference.matrix * axis;
  }
  return cost;
}

}  // namespace

FrameSolution SolveWithCeres(const FrameProblem& problem) {
  FrameSolution solution{problem.start, 0};
  ceres::Problem ceres_problem;
  for (geometry::Rigid3& pose : solution.pose) {
    ceres_problem.AddParameterBlock(pose.rotation.coeffs().data(), 4, new ceres::EigenQuaternionManifold);
    ceres_problem.AddParameterBlock(pose.translation.data(), 3);
  }
  const auto rotation = [&](std::int32_t patch) { return solution.pose[static_cast<std::size_t>(patch)].rotation.coeffs().data(); };
  const auto translation = [&](std::int32_t patch) { return solution.pose[static_cast<std::size_t>(patch)].translation.data(); };
  for (const PlaneTerm& term : problem.terms) {
    ceres_problem.AddResidualBlock(new ceres::AutoDiffCostFunction<PlaneCost, 1, 4, 3>(new PlaneCost{term}), nullptr, rotation(term.patch),
                                   translation(term.patch));
  }
  for (std::size_t e = 0; e < problem.model.edges.size(); ++e) {
    const tracking::PatchEdge& edge = problem.model.edges[e];
    auto* cost = new ceres::AutoDiffCostFunction<EdgeCost, 12, 4, 3, 4, 3>(new EdgeCost(CostOf(edge, problem.reference[e], problem.regulariser)));
    ceres_problem.AddResidualBlock(cost, nullptr, rotation(edge.k), translation(edge.k), rotation(edge.l), translation(edge.l));
  }
  ceres::Solver::Options options;
  options.linear_solver_type = ceres::SPARSE_NORMAL_CHOLESKY;
  options.sparse_linear_algebra_library_type = ceres::SUITE_SPARSE;
  options.num_threads = 1;
  options.function_tolerance = kEnergyTolerance;
  options.logging_type = ceres::SILENT;
  ceres::Solver::Summary summary;
  ceres::Solve(options, &ceres_problem, &summary);
  solution.iterations = summary.num_successful_steps;
  return solution;
}

}  // namespace vorocast::bench
