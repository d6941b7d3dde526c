// SPDX-License-Identifier: AGPL-3.0-or-later
#include <gtest/gtest.h>

#include <cmath>

#include "services/base/random.h"
#include "tests/unit/workers/tracking/limb.h"
#include "workers/tracking/normal_equations.h"
#include "workers/tracking/point_grid.h"
#include "workers/tracking/regulariser.h"

namespace vorocast::tracking {
namespace {

using geometry::Mat3;
using geometry::Quat;
using geometry::Rigid3;
using geometry::Vec3;

Vec3 RandomVector(base::Random& random) { return {random.Uniform(-1, 1), random.Uniform(-1, 1), random.Uniform(-1, 1)}; }

Rigid3 RandomPose(base::Random& random, double turn, double move) {
  const Vec3 axis = RandomVector(random).normalized();
  return {Quat(Eigen::AngleAxisd(turn * random.Uniform(), axis)), move * RandomVector(random)};
}

Pose RandomPoses(const PatchModel& model, std::uint64_t seed) {
  base::Random random(seed);
  Pose pose;
  for (std::int32_t k = 0; k < model.patch_count; ++k) pose.push_back(RandomPose(random, 0.4, 0.05));
  return pose;
}

PatchModel LimbModel() {
  const geometry::Template model = LimbTemplate(0);
  return BuildPatchModel(model.cells, model.patch, model.patch_count);
}

/// The pose after the small twist of one patch, by the same convention as the equations.
Pose Nudged(const PatchModel& model, Pose pose, std::int32_t patch, int component, double step) {
  std::vector<Vector6> twists(static_cast<std::size_t>(model.patch_count), Vector6::Zero());
  twists[patch][component] = step;
  ApplyTwists(model, twists, pose);
  return pose;
}

TEST(DataBlock, DerivativesMatchNumericOnes) {
  base::Random random(4);
  const Vec3 arm = RandomVector(random);
  const Vec3 target = arm + 0.3 * RandomVector(random);
  const Vec3 normal = RandomVector(random).normalized();
  // Energy of one point-to-plane and one point-to-point term after a twist about the centre (the origin here).
  const auto energy = [&](const Vector6& twist) {
    const Vec3 omega = twist.head<3>();
    const Vec3 p = Mat3(Eigen::AngleAxisd(omega.norm(), omega.norm() > 0 ? Vec3(omega.normalized()) : Vec3::UnitX())) * arm + twist.tail<3>();
    return 2 * std::pow(normal.dot(p - target), 2) + 0.7 * (p - target).squaredNorm();
  };
  DataBlock block;
  block.AddPointToPlane(arm, normal, arm - target, 2);
  block.AddPointToPoint(arm, arm - target, 0.7);
  EXPECT_NEAR(block.energy(), energy(Vector6::Zero()), 1e-12);
  Matrix6 h = Matrix6::Zero();
  Vector6 g = Vector6::Zero();
  block.AddTo(h, g, 1);
  for (int i = 0; i < 6; ++i) {
    constexpr double kStep = 1e-5;
    EXPECT_NEAR(2 * g[i], (energy(kStep * Vector6::Unit(i)) - energy(-kStep * Vector6::Unit(i))) / (2 * kStep), 1e-7) << i;
  }
  // Gauss–Newton's H from the Jacobian, written out.
  Eigen::Matrix<double, 1, 6> row;
  row << (arm.cross(normal)).transpose(), normal.transpose();
  Eigen::Matrix<double, 3, 6> point;
  point << -Cross(arm), Mat3::Identity();
  EXPECT_TRUE(h.isApprox(2 * row.transpose() * row + 0.7 * point.transpose() * point, 1e-12));
}

TEST(PoseDistance, IsTheSumOverTheCellsOfBothPatches) {
  const geometry::Template limb = LimbTemplate(0);
  const PatchModel model = BuildPatchModel(limb.cells, limb.patch, limb.patch_count);
  const Pose pose = RandomPoses(model, 1);
  const Pose other = RandomPoses(model, 2);
  double expected = 0;
  for (const PatchEdge& edge : model.edges) {
    const Rigid3 here = pose[edge.l].Inverse() * pose[edge.k];
    const Rigid3 there = other[edge.l].Inverse() * other[edge.k];
    for (std::size_t c = 0; c < limb.cells.size(); ++c) {
      if (limb.patch[c] != edge.k && limb.patch[c] != edge.l) continue;
      // Six points that have a cell's own extent: 0.08 V^(2/3) along each axis.
      const double reach = std::sqrt(3 * 0.08) * std::cbrt(limb.cells.volume[c]);
      for (int i = 0; i < 6; ++i) {
        const Vec3 x = limb.cells.centroid[c] + (i % 2 == 0 ? reach : -reach) * Vec3::Unit(i / 2);
        expected += (here * x - there * x).squaredNorm() / 6;
      }
    }
  }
  EXPECT_NEAR(PoseDistance(model, pose, RelationsOf(model, other)), expected, 1e-9 * expected);
}

TEST(PoseDistance, IsZeroForARigidMotionOfTheWhole) {
  const PatchModel model = LimbModel();
  base::Random random(3);
  const Rigid3 motion = RandomPose(random, 3, 2);
  const Pose rest = RandomPoses(model, 5);
  Pose moved;
  for (const Rigid3& pose : rest) moved.push_back(motion * pose);
  EXPECT_NEAR(PoseDistance(model, moved, RelationsOf(model, rest)), 0, 1e-12);
}

TEST(PoseDistance, DerivativesMatchNumericOnes) {
  const PatchModel model = LimbModel();
  const Pose pose = RandomPoses(model, 7);
  const auto reference = RelationsOf(model, RandomPoses(model, 8));
  NormalEquations equations(model);
  AddPoseDistance(model, pose, reference, 1, equations);
  for (const std::int32_t k : {0, 5, model.patch_count - 1}) {
    for (int i = 0; i < 6; ++i) {
      constexpr double kStep = 1e-5;
      const double after = PoseDistance(model, Nudged(model, pose, k, i, kStep), reference);
      const double before = PoseDistance(model, Nudged(model, pose, k, i, -kStep), reference);
      const double numeric = (after - before) / (2 * kStep);
      EXPECT_NEAR(2 * equations.Gradient(k)[i], numeric, 1e-6 * std::max(1.0, std::abs(numeric))) << k << " " << i;
    }
  }
}

TEST(PoseDistance, HessianMatchesNumericOneWhereTheResidualsVanish) {
  // There Gauss–Newton's H is the whole second derivative, the blocks between patches included.
  const PatchModel model = LimbModel();
  const Pose pose = RandomPoses(model, 9);
  const auto reference = RelationsOf(model, pose);
  NormalEquations equations(model);
  AddPoseDistance(model, pose, reference, 1, equations);
  constexpr double kStep = 1e-4;
  for (const std::size_t e : {std::size_t{0}, model.edges.size() / 2}) {
    const PatchEdge& edge = model.edges[e];
    for (int i = 0; i < 6; ++i) {
      for (int j = 0; j < 6; ++j) {
        double numeric = 0;
        for (const int s : {-1, 1}) {
          for (const int t : {-1, 1}) {
            const Pose moved = Nudged(model, Nudged(model, pose, edge.l, i, s * kStep), edge.k, j, t * kStep);
            numeric += s * t * PoseDistance(model, moved, reference) / (4 * kStep * kStep);
          }
        }
        EXPECT_NEAR(2 * equations.Lower(e)(i, j), numeric, 1e-3) << i << " " << j;
      }
    }
  }
}

TEST(NormalEquations, SolveLikeADenseSolver) {
  const PatchModel model = LimbModel();
  NormalEquations equations(model);
  AddPoseDistance(model, RandomPoses(model, 1), RelationsOf(model, RandomPoses(model, 2)), 1, equations);
  const int size = 6 * model.patch_count;
  Eigen::MatrixXd dense = Eigen::MatrixXd::Zero(size, size);
  Eigen::VectorXd right(size);
  for (std::int32_t k = 0; k < model.patch_count; ++k) {
    equations.Diagonal(k) += Matrix6::Identity();
    dense.block<6, 6>(6 * k, 6 * k) = equations.Diagonal(k);
    right.segment<6>(6 * k) = -equations.Gradient(k);
  }
  for (std::size_t e = 0; e < model.edges.size(); ++e) {
    dense.block<6, 6>(6 * model.edges[e].l, 6 * model.edges[e].k) = equations.Lower(e);
    dense.block<6, 6>(6 * model.edges[e].k, 6 * model.edges[e].l) = equations.Lower(e).transpose();
  }
  std::vector<Vector6> twists;
  ASSERT_TRUE(equations.Solve(0, twists));
  const Eigen::VectorXd expected = dense.fullPivLu().solve(right);
  for (std::int32_t k = 0; k < model.patch_count; ++k) EXPECT_TRUE(twists[k].isApprox(expected.segment<6>(6 * k), 1e-8)) << k;
}

TEST(BlockCholesky, RefusesWhatIsNotPositiveDefinite) {
  BlockCholesky cholesky(2, {{0, 1}});
  cholesky.Diagonal(0) = Matrix6::Identity();
  cholesky.Diagonal(1) = Matrix6::Identity();
  cholesky.SetLower(0, 0.9 * Matrix6::Identity());
  EXPECT_TRUE(cholesky.Factorise());
  cholesky.Clear();
  cholesky.Diagonal(0) = Matrix6::Identity();
  cholesky.Diagonal(1) = Matrix6::Identity();
  cholesky.SetLower(0, 1.1 * Matrix6::Identity());
  EXPECT_FALSE(cholesky.Factorise());
}

TEST(PointGrid, VisitsEveryPointWithinReach) {
  base::Random random(12);
  std::vector<PosedPoint> points;
  for (std::int32_t i = 0; i < 2000; ++i) points.push_back({0.3F * RandomVector(random).cast<float>(), geometry::Vec3f::Zero(), 0, i});
  PointGrid grid;
  grid.Build(points, 0.04F);
  for (int query = 0; query < 200; ++query) {
    const geometry::Vec3f x = 0.4F * RandomVector(random).cast<float>();
    std::vector<int> visits(points.size(), 0);
    grid.VisitNear(x, [&](const PosedPoint& point) { ++visits[point.patch]; });
    for (std::size_t i = 0; i < points.size(); ++i) {
      EXPECT_LE(visits[i], 1);
      if ((points[i].position - x).norm() < 0.04F) {
        EXPECT_EQ(visits[i], 1);
      }
    }
  }
}

}  // namespace
}  // namespace vorocast::tracking
