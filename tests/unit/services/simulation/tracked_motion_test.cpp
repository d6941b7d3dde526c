// SPDX-License-Identifier: AGPL-3.0-or-later
#include "services/simulation/tracked_motion.h"

#include <gtest/gtest.h>

#include <cmath>

#include "services/simulation/release_schedule.h"
#include "services/simulation/scene.h"
#include "tests/unit/services/simulation/synthetic_take.h"

namespace vorocast::simulation {
namespace {

using geometry::Quat;
using geometry::Rigid3;
using geometry::Vec3;
using testing::Animate;
using testing::CubeBlock;

/// Turning at a constant rate about a fixed axis is what slerp reproduces exactly; moving at a constant speed, what a line does.
TEST(TrackedMotion, ReproducesSteadyMotionBetweenFrames) {
  const Vec3 axis = Vec3(1, -2, 0.5).normalized();
  const auto motion = [&](const Vec3& centre, double t) {
    const Quat turn(Eigen::AngleAxisd(2.5 * t, axis));
    // The centroid moves along a line while the cell turns about it.
    return Rigid3{turn, Vec3(centre + t * Vec3(1, 2, 3) - turn * centre)};
  };
  const auto take = Animate(CubeBlock(2, 2, 2, 0.1), 6, 25, motion);
  const TrackedMotion tracked(take);
  EXPECT_DOUBLE_EQ(tracked.duration_s(), 0.2);
  std::vector<Rigid3> pose;
  for (const double t : {0.0, 0.013, 0.04, 0.0999, 0.2}) {
    tracked.Sample(t, pose);
    for (std::size_t c = 0; c < pose.size(); ++c) {
      const Vec3 centroid = take.model.cells.centroid[c] + t * Vec3(1, 2, 3);
      EXPECT_LT((pose[c].translation - centroid).norm(), 1e-7) << t;
      EXPECT_LT(pose[c].rotation.angularDistance(Quat(Eigen::AngleAxisd(2.5 * t, axis))), 1e-6) << t;
    }
  }
}

TEST(TrackedMotion, HoldsTheEnds) {
  const auto take = Animate(CubeBlock(1, 1, 1, 0.1), 3, 25, testing::Sway);
  const TrackedMotion tracked(take);
  std::vector<Rigid3> pose;
  tracked.Sample(-1, pose);
  EXPECT_EQ(pose[0].translation, tracked.AtFrame(0)[0].translation);
  tracked.Sample(100, pose);
  EXPECT_EQ(pose[0].translation, tracked.AtFrame(2)[0].translation);
}

TEST(TrackedMotion, SkippedFramesKeepTheirTime) {
  auto take = Animate(CubeBlock(1, 1, 1, 0.1), 3, 25, [](const Vec3&, double t) { return Rigid3{Quat::Identity(), Vec3(t, 0, 0)}; });
  take.patches.frames = {10, 11, 15};
  const TrackedMotion tracked(take);
  EXPECT_DOUBLE_EQ(tracked.duration_s(), 0.2);
  std::vector<Rigid3> pose;
  tracked.Sample(0.12, pose);  // half way from frame 11 to frame 15
  EXPECT_NEAR(pose[0].translation.x(), 0.06, 1e-9);
}

TEST(CheckTake, RefusesWhatDoesNotFit) {
  const auto good = Animate(CubeBlock(2, 1, 1, 0.1), 3, 25, testing::Still);
  EXPECT_TRUE(CheckTake(good).ok());
  auto take = good;
  take.cell_rotation.pop_back();
  EXPECT_EQ(CheckTake(take).code(), absl::StatusCode::kInvalidArgument);
  take = good;
  take.cell_translation[3].x() = NAN;
  EXPECT_EQ(std::string(CheckTake(take).message()), "tracked take: frame 1, cell 1: the pose is not finite, or its rotation is no unit quaternion");
  take = good;
  take.cell_rotation[0].setZero();
  EXPECT_FALSE(CheckTake(take).ok());
  take = good;
  take.model.cells.vertex[0] = 1000;
  EXPECT_FALSE(CheckTake(take).ok());
  take = good;
  take.model.cells.face_offset[1] = -1;
  EXPECT_FALSE(CheckTake(take).ok());
  take = good;
  take.patches.frames = {0, 2, 2};
  EXPECT_FALSE(CheckTake(take).ok());
  EXPECT_FALSE(CheckTake(geometry::TrackedTake{}).ok());
}

TEST(ReleaseSchedule, GoesByHeight) {
  const auto take = Animate(CubeBlock(1, 5, 1, 0.1), 3, 25, testing::Still);
  const TrackedMotion motion(take);
  const MaskSubject subject(take.model, motion, Vec3::Zero());
  const auto times = [&](const ReleaseByHeight& rule) { return ScheduleRelease(motion, subject, {ReleaseRule{.by = rule}}, 10).release; };
  const auto from_top = times({.from_top = true, .start_s = 1, .end_s = 3});
  const auto from_bottom = times({.from_top = false, .start_s = 0, .end_s = 4});
  const auto upper_half = times({.from_top = true, .start_s = 1, .end_s = 2, .share = 0.5});
  for (std::size_t c = 0; c < 5; ++c) {
    EXPECT_NEAR(from_top[c], 3 - 0.5 * static_cast<double>(c), 1e-9);
    EXPECT_NEAR(from_bottom[c], static_cast<double>(c), 1e-9);
  }
  EXPECT_TRUE(std::isinf(upper_half[0]));
  EXPECT_TRUE(std::isinf(upper_half[1]));
  EXPECT_NEAR(upper_half[2], 2, 1e-9);
  EXPECT_NEAR(upper_half[4], 1, 1e-9);
  EXPECT_TRUE(std::isinf(ScheduleRelease(motion, subject, {}, 10).release[0]));
}

TEST(Scene, LowestPointIsOverAllFramesAndCorners) {
  // A cube on its corner dips √3/2 edges below its centre, at one frame only.
  const Quat on_corner = Quat::FromTwoVectors(Vec3(1, 1, 1), Vec3(0, -1, 0));
  const auto take = Animate(CubeBlock(1, 1, 1, 0.2, 0), 5, 25, [&](const Vec3& centre, double t) {
    const Quat turn = std::abs(t - 0.08) < 1e-6 ? on_corner : Quat::Identity();
    return Rigid3{turn, Vec3(centre - turn * centre)};
  });
  EXPECT_NEAR(LowestPoint(take.model.cells, TrackedMotion(take)), 0.1 - 0.1 * std::sqrt(3.0), 1e-6);
}

TEST(Scene, AutoPendulumPassesThroughTheThinMiddleAtTheHit) {
  // A slab, thin along x, standing on y = 0, moving along z.
  const auto take = Animate(CubeBlock(2, 20, 8, 0.05), 51, 25, [](const Vec3&, double t) { return Rigid3{Quat::Identity(), Vec3(0.5, 0, t)}; });
  const Effect effect{.objects = {PendulumSettings{.name = "p", .arm_m = 2, .hit_time_s = 1.2, .hit_height = 0.6}}};
  const auto scene = MakeScene(effect, take.model.cells, TrackedMotion(take));
  ASSERT_TRUE(scene.ok());
  const SceneBody& body = scene->bodies[0];
  const Vec3 ball = body.DrivenPose(1.2).translation;
  EXPECT_LT((ball - Vec3(0.5, 0.025 + 0.6 * 0.95, 1.2)).norm(), 1e-6);
  const Vec3 moved = body.DrivenPose(1.201).translation - ball;
  EXPECT_GT(moved.x(), 0.99 * moved.norm());
  EXPECT_TRUE(geometry::IsClosed(body.mesh));
  EXPECT_GT(geometry::SignedVolume(body.mesh), 0);
}

TEST(Scene, APendulumNeedsGravity) {
  const auto take = Animate(CubeBlock(2, 2, 2, 0.05), 2, 25, testing::Still);
  const Effect effect{.gravity_m_s2 = 0, .objects = {PendulumSettings{.name = "p"}}};
  const auto scene = MakeScene(effect, take.model.cells, TrackedMotion(take));
  ASSERT_FALSE(scene.ok());
  EXPECT_EQ(std::string(scene.status().message()), "effect: gravity_m_s2: the pendulum \"p\" swings only with gravity above 0, not 0");
}

TEST(Scene, PositionsCountFromUnderTheTake) {
  const auto take = Animate(CubeBlock(2, 2, 2, 0.1, 0.3), 2, 25, [](const Vec3&, double) { return Rigid3{Quat::Identity(), Vec3(5, 0, -2)}; });
  const Effect effect{.objects = {SphereSettings{.placement = {.name = "a", .position_m = Vec3(1, 2, 3)}},
                                  BoxSettings{.placement = {.name = "b", .position_m = Vec3(1, 2, 3), .origin_is_take = false}}}};
  const auto scene = MakeScene(effect, take.model.cells, TrackedMotion(take));
  ASSERT_TRUE(scene.ok());
  EXPECT_LT((scene->bodies[0].start.position - Vec3(6, 2.3, 1)).norm(), 1e-6);
  EXPECT_LT((scene->bodies[1].start.position - Vec3(1, 2, 3)).norm(), 1e-12);
  EXPECT_NEAR(*scene->ground_height, 0.3, 1e-6);
  for (const SceneBody& body : scene->bodies) EXPECT_TRUE(geometry::IsClosed(body.mesh));
  EXPECT_NEAR(geometry::SignedVolume(scene->bodies[1].mesh), 0.027, 1e-9);
}

}  // namespace
}  // namespace vorocast::simulation
