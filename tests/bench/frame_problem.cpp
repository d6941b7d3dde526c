// SPDX-License-Identifier: AGPL-3.0-or-later
#include "tests/bench/frame_problem.h"

#include <limits>

#include "workers/tracking/normal_equations.h"

namespace vorocast::bench {
namespace {

using geometry::Vec3;
using tracking::DataBlock;
using tracking::Pose;

// As tracking associates and weighs in its last iterations, on captures with known motion.
constexpr double kReach_m = 0.030;
constexpr double kCosineMin = 0.7;
constexpr double kRegulariserOfPoints = 0.06;
constexpr int kIterationsMax = 50;

void AddData(const FrameProblem& problem, const Pose& pose, tracking::NormalEquations& equations) {
  std::vector<DataBlock> blocks(pose.size());
  for (const PlaneTerm& term : problem.terms) {
    const auto k = static_cast<std::size_t>(term.patch);
    const Vec3 posed = pose[k] * term.template_point;
    blocks[k].AddPointToPlane(posed - pose[k] * problem.model.centre[k], term.normal, posed - term.observed, 1);
  }
  for (std::int32_t k = 0; k < problem.model.patch_count; ++k) {
    blocks[static_cast<std::size_t>(k)].AddTo(equations.Diagonal(k), equations.Gradient(k), 1);
  }
}

}  // namespace

double FrameProblem::DataEnergy(const Pose& pose) const {
  double energy = 0;
  for (const PlaneTerm& term : terms) {
    const double residual = term.normal.dot(pose[static_cast<std::size_t>(term.patch)] * term.template_point - term.observed);
    energy += residual * residual;
  }
  return energy;
}

double FrameProblem::Energy(const Pose& pose) const { return DataEnergy(pose) + regulariser * tracking::PoseDistance(model, pose, reference); }

FrameProblem MakeFrameProblem(const geometry::Template& model, const tracking::Observation& frame, Pose start) {
  FrameProblem problem;
  problem.model = tracking::BuildPatchModel(model.cells, model.patch, model.patch_count);
  problem.start = std::move(start);
  problem.reference = tracking::RelationsOf(problem.model, Pose(problem.start.size()));
  std::vector<Vec3> position, normal;
  for (const tracking::SurfaceSample& sample : problem.model.surface) {
    const geometry::Rigid3& pose = problem.start[static_cast<std::size_t>(sample.patch)];
    position.push_back(pose * sample.position);
    normal.push_back(pose.rotation * sample.normal);
  }
  for (std::size_t i = 0; i < frame.surface.size(); ++i) {
    const Vec3& x = frame.surface.positions[i];
    double least = kReach_m * kReach_m;
    std::size_t nearest = std::numeric_limits<std::size_t>::max();
    for (std::size_t s = 0; s < position.size(); ++s) {
      const double squared = (position[s] - x).squaredNorm();
      if (squared < least && normal[s].dot(frame.surface.normals[i]) > kCosineMin) least = squared, nearest = s;
    }
    if (nearest == std::numeric_limits<std::size_t>::max()) continue;
    const tracking::SurfaceSample& sample = problem.model.surface[nearest];
    problem.terms.push_back({sample.patch, sample.position, x, frame.surface.normals[i]});
  }
  problem.regulariser = kRegulariserOfPoints * static_cast<double>(problem.terms.size()) / problem.model.edge_mass;
  return problem;
}

FrameSolution SolveWithBlocks(const FrameProblem& problem) {
  tracking::NormalEquations equations(problem.model);
  std::vector<tracking::Vector6> twists;
  FrameSolution solution{problem.start, 0};
  double energy = problem.Energy(solution.pose);
  while (solution.iterations < kIterationsMax) {
    equations.Clear();
    AddData(problem, solution.pose, equations);
    tracking::AddPoseDistance(problem.model, solution.pose, problem.reference, problem.regulariser, equations);
    Pose next = solution.pose;
    if (!equations.Solve(1e-9, twists)) break;
    tracking::ApplyTwists(problem.model, twists, next);
    const double next_energy = problem.Energy(next);
    if (next_energy > energy) break;
    ++solution.iterations;
    solution.pose = std::move(next);
    const double change = energy - next_energy;
    energy = next_energy;
    if (change < kEnergyTolerance * energy) break;
  }
  return solution;
}

}  // namespace vorocast::bench
