// SPDX-License-Identifier: AGPL-3.0-or-later
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/unit/workers/tracking/limb.h"
#include "workers/tracking/tracking.h"

namespace vorocast::tracking {
namespace {

using geometry::FrameState;
using geometry::PoseTrack;
using geometry::Quat;
using geometry::Rigid3;
using geometry::Vec3;

/// The body turning about z through its own middle `centre` and moving along a line, both steadily.
Rigid3 SteadyMotion(const Vec3& centre, double frame) {
  const Quat turn(Eigen::AngleAxisd(0.2 * frame, Vec3::UnitZ()));
  return {turn, centre + frame * Vec3(0.1, 0.02, 0) - turn * centre};
}

TEST(Assemble, PutsAMissingFrameInTheMiddleOfItsNeighbours) {
  const geometry::Template model = LimbTemplate(0);
  PoseTrack window = ConstantTrack(model, {0, 2}, {});
  std::vector<Vec3> centres;
  for (std::int32_t k = 0; k < model.patch_count; ++k) {
    // Volumes are all equal, so the patch's centre is the mean of its centroids.
    Vec3 centre = Vec3::Zero();
    double cells = 0;
    for (std::size_t c = 0; c < model.cells.size(); ++c) {
      if (model.patch[c] == k) centre += model.cells.centroid[c], cells += 1;
    }
    centre /= cells;
    centres.push_back(centre);
    window.Pose(0, k) = SteadyMotion(centre, 0);
    window.Pose(1, k) = SteadyMotion(centre, 2);
  }
  const auto take = Assemble(model, {window}, {.frames = {0, 1, 2}});
  ASSERT_TRUE(take.ok()) << take.status();
  EXPECT_EQ(take->patches.state[1], FrameState::kInterpolated);
  for (std::int32_t k = 0; k < model.patch_count; ++k) {
    const Rigid3& pose = take->patches.Pose(1, k);
    EXPECT_NEAR(pose.rotation.angularDistance(Quat(Eigen::AngleAxisd(0.2, Vec3::UnitZ()))), 0, 1e-7);
    // The centre has gone half of the way in a straight line.
    const Vec3 centre = centres[k];
    EXPECT_LT((pose * centre - SteadyMotion(centre, 1) * centre).norm(), 1e-9);
  }
}

TEST(Assemble, InterpolatesAnUnevenGapInProportion) {
  const geometry::Template model = LimbTemplate(0);
  PoseTrack window = ConstantTrack(model, {0, 4}, {});
  for (std::int32_t k = 0; k < model.patch_count; ++k) window.Pose(1, k).translation = Vec3(0.4, 0, 0);
  const auto take = Assemble(model, {window}, {.frames = {0, 1, 3, 4, 6}});
  ASSERT_TRUE(take.ok()) << take.status();
  const double expected[] = {0, 0.1, 0.3, 0.4, 0.4};
  for (std::size_t f = 0; f < 5; ++f) {
    EXPECT_NEAR(take->patches.Pose(f, 3).translation.x(), expected[f], 1e-12);
    for (std::size_t c = 0; c < take->cell_count(); ++c) EXPECT_NEAR(take->CellPose(f, c).translation.x(), expected[f], 1e-12);
  }
}

TEST(Assemble, FadesFromOneWindowIntoTheNext) {
  const geometry::Template model = LimbTemplate(0);
  const PoseTrack early = ConstantTrack(model, {0, 1, 2, 3, 4, 5}, {});
  const PoseTrack late = ConstantTrack(model, {3, 4, 5, 6, 7, 8}, {Quat::Identity(), Vec3(1, 0, 0)});
  AssembleOptions options;
  for (std::int32_t f = 0; f < 9; ++f) options.frames.push_back(f);
  const auto take = Assemble(model, {early, late}, options);
  ASSERT_TRUE(take.ok()) << take.status();
  const double expected[] = {0, 0, 0, 0.25, 0.5, 0.75, 1, 1, 1};
  for (std::size_t f = 0; f < 9; ++f) EXPECT_NEAR(take->patches.Pose(f, 0).translation.x(), expected[f], 1e-12) << f;
}

TEST(Assemble, NamesTheFramesWhenTooManyAreMissing) {
  const geometry::Template model = LimbTemplate(0);
  const PoseTrack window = ConstantTrack(model, {0, 1}, {});
  const auto take = Assemble(model, {window}, {.frames = {0, 1, 2, 3, 4}, .interpolated_max = 2});
  EXPECT_EQ(take.status().code(), absl::StatusCode::kInvalidArgument);
  EXPECT_THAT(std::string(take.status().message()), testing::HasSubstr("frames 2, 3, 4"));
}

TEST(Assemble, MovesCellsRigidlyWhenAllPatchesMoveAlike) {
  const geometry::Template model = LimbTemplate(0);
  const Rigid3 motion{Quat(Eigen::AngleAxisd(2.5, Vec3(1, -1, 2).normalized())), Vec3(3, -2, 1)};
  PoseTrack window = ConstantTrack(model, {0}, motion);
  // Half of them with the other sign of the quaternion, which is the same rotation.
  for (std::int32_t k = 0; k < model.patch_count; k += 2) window.Pose(0, k).rotation.coeffs() *= -1;
  const auto take = Assemble(model, {window}, {.frames = {0}});
  ASSERT_TRUE(take.ok()) << take.status();
  const std::vector<Vec3> points = LimbMesh().vertices;
  const auto carried = CarryPoints(*take, points);
  for (std::size_t i = 0; i < points.size(); ++i) EXPECT_LT((carried[i] - motion * points[i]).norm(), 1e-6);
}

TEST(Assemble, KeepsQuaternionsOnOneSideThroughTime) {
  const geometry::Template model = LimbTemplate(0);
  PoseTrack window = ConstantTrack(model, {0, 1, 2}, {});
  for (std::int32_t k = 0; k < model.patch_count; ++k) window.Pose(1, k).rotation.coeffs() *= -1;
  const auto take = Assemble(model, {window}, {.frames = {0, 1, 2}});
  ASSERT_TRUE(take.ok()) << take.status();
  for (std::size_t f = 1; f < 3; ++f) {
    EXPECT_GT(take->patches.Pose(f, 0).rotation.dot(take->patches.Pose(f - 1, 0).rotation), 0);
    EXPECT_GT(take->cell_rotation[f * take->cell_count()].dot(take->cell_rotation[(f - 1) * take->cell_count()]), 0);
  }
}

TEST(CarryPoints, BendsSmoothlyBetweenPatches) {
  // Patches posed by the analytic bend at their centres: points between them must follow the bend, not the nearest patch.
  const geometry::Template model = LimbTemplate(0);
  PoseTrack window = ConstantTrack(model, {0}, {});
  std::vector<Vec3> centre(static_cast<std::size_t>(model.patch_count), Vec3::Zero());
  std::vector<double> cells(centre.size(), 0);
  for (std::size_t c = 0; c < model.cells.size(); ++c) centre[model.patch[c]] += model.cells.centroid[c], cells[model.patch[c]] += 1;
  constexpr double kAngle = 0.5;
  for (std::size_t k = 0; k < centre.size(); ++k) {
    centre[k] /= cells[k];
    constexpr double kStep = 1e-5;
    geometry::Mat3 gradient;
    for (int i = 0; i < 3; ++i) {
      gradient.col(i) = (Bend(centre[k] + kStep * Vec3::Unit(i), kAngle) - Bend(centre[k] - kStep * Vec3::Unit(i), kAngle)) / (2 * kStep);
    }
    const Eigen::JacobiSVD<geometry::Mat3> svd(gradient, Eigen::ComputeFullU | Eigen::ComputeFullV);
    const Quat rotation = Quat(geometry::Mat3(svd.matrixU() * svd.matrixV().transpose())).normalized();
    window.Pose(0, k) = {rotation, Bend(centre[k], kAngle) - rotation * centre[k]};
  }
  const auto take = Assemble(model, {window}, {.frames = {0}});
  ASSERT_TRUE(take.ok()) << take.status();
  const auto carried = CarryPoints(*take, model.cells.centroid);
  double blended = 0;
  double rigid = 0;
  for (std::size_t c = 0; c < model.cells.size(); ++c) {
    const Vec3 truth = Bend(model.cells.centroid[c], kAngle);
    blended += (carried[c] - truth).norm();
    rigid += (window.Pose(0, model.patch[c]) * model.cells.centroid[c] - truth).norm();
  }
  EXPECT_LT(blended, rigid);
  EXPECT_LT(blended / static_cast<double>(carried.size()), 0.002);
}

TEST(Assemble, WindowsThatDisagreeFadeIntoEachOtherWithoutAJump) {
  // Both windows move evenly, 6 cm apart; they share three frames, so that each step of the fade is a quarter of that.
  const geometry::Template model = LimbTemplate(0);
  constexpr double kApart = 0.06;
  constexpr double kSpeed = 0.02;
  std::vector<PoseTrack> windows{ConstantTrack(model, {0, 1, 2, 3, 4, 5, 6, 7, 8, 9}, {}),
                                 ConstantTrack(model, {7, 8, 9, 10, 11, 12, 13, 14, 15, 16}, {})};
  for (std::size_t w = 0; w < 2; ++w) {
    for (std::size_t f = 0; f < 10; ++f) {
      for (std::int32_t k = 0; k < model.patch_count; ++k) {
        windows[w].Pose(f, k).translation.x() = kSpeed * windows[w].frames[f] + kApart * static_cast<double>(w);
      }
    }
  }
  AssembleOptions options;
  for (std::int32_t f = 0; f < 17; ++f) options.frames.push_back(f);
  const auto take = Assemble(model, windows, options);
  ASSERT_TRUE(take.ok()) << take.status();
  double total = 0;
  for (std::size_t f = 1; f < 17; ++f) {
    const double step = take->CellPose(f, 0).translation.x() - take->CellPose(f - 1, 0).translation.x() - kSpeed;
    EXPECT_GT(step, -1e-9) << f;
    EXPECT_LT(step, kApart / 4 + 1e-9) << f;
    total += step;
  }
  EXPECT_NEAR(total, kApart, 1e-9);
}

}  // namespace
}  // namespace vorocast::tracking
