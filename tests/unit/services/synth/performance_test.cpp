// SPDX-License-Identifier: AGPL-3.0-or-later
#include "services/synth/performance.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "services/synth/choreography.h"
#include "services/synth/depth_cameras.h"
#include "services/synth/synth.h"
#include "tests/unit/services/synth/closest_point.h"

namespace vorocast::synth {
namespace {

using geometry::Vec3;

constexpr std::int32_t kFrames = 150;

const Dance& SixSeconds() {
  static const Dance kDance(kFrames, 25);
  return kDance;
}

/// The triangles whose vertices all lie in [first, last), renumbered from 0.
geometry::TriangleMesh Shell(const Performance& performance, const std::vector<Vec3>& vertices, std::size_t first, std::size_t last) {
  geometry::TriangleMesh shell;
  shell.vertices.assign(vertices.begin() + static_cast<std::ptrdiff_t>(first), vertices.begin() + static_cast<std::ptrdiff_t>(last));
  for (const auto& t : performance.surface().triangles) {
    if (std::ranges::all_of(t, [&](std::int32_t v) { return static_cast<std::size_t>(v) >= first && static_cast<std::size_t>(v) < last; })) {
      const auto offset = static_cast<std::int32_t>(first);
      shell.triangles.push_back({t[0] - offset, t[1] - offset, t[2] - offset});
    }
  }
  return shell;
}

TEST(Dance, IsThreeClosedShellsOfAPersonsSizeInEveryFrame) {
  const Dance& dance = SixSeconds();
  EXPECT_TRUE(geometry::IsClosed(dance.surface()));
  const std::size_t end = dance.surface().vertices.size();
  EXPECT_EQ(dance.surface().colours.size(), end);
  EXPECT_EQ(dance.part().size(), end);
  for (std::int32_t frame = 0; frame < kFrames; frame += 30) {
    const std::vector<Vec3> vertices = dance.VerticesAt(frame);
    ASSERT_EQ(vertices.size(), end);
    const geometry::TriangleMesh body = Shell(dance, vertices, 0, dance.skirt_begin());
    const geometry::TriangleMesh skirt = Shell(dance, vertices, dance.skirt_begin(), dance.cage_begin());
    const geometry::TriangleMesh cage = Shell(dance, vertices, dance.cage_begin(), end);
    EXPECT_EQ(body.triangles.size() + skirt.triangles.size() + cage.triangles.size(), dance.surface().triangles.size());
    // A slim adult of 1.75 m displaces about 60 litres; the cloth is as thick as it says.
    EXPECT_GT(geometry::SignedVolume(body), 0.050);
    EXPECT_LT(geometry::SignedVolume(body), 0.075);
    EXPECT_NEAR(2 * geometry::SignedVolume(skirt) / geometry::SurfaceArea(skirt), 0.015, 0.0015);
    EXPECT_NEAR(geometry::SignedVolume(cage), geometry::SignedVolume(Shell(dance, dance.VerticesAt(0), dance.cage_begin(), end)), 1e-9);
  }
}

TEST(Dance, StandsOnTheFloorAndStaysNearItsPlace) {
  const Dance& dance = SixSeconds();
  for (std::int32_t frame = 0; frame < kFrames; frame += 5) {
    geometry::Box3 box;
    for (const Vec3& x : dance.VerticesAt(frame)) box.extend(x);
    EXPECT_GT(box.min().y(), -0.02) << frame;  // a toe that pushes off may dip a little below the ideal floor
    EXPECT_LT(box.min().y(), 0.02) << frame;
    EXPECT_GT(box.max().y(), 1.65) << frame;
    EXPECT_LT(box.max().y(), 2.3) << frame;
    EXPECT_LT(std::max(box.sizes().x(), box.sizes().z()), 2.2) << frame;
  }
}

TEST(Dance, MovesEverywhereButNowhereMoreThanSixCentimetresAFrame) {
  const Dance& dance = SixSeconds();
  std::vector<Vec3> before = dance.VerticesAt(0);
  double farthest = 0, sum = 0;
  for (std::int32_t frame = 1; frame < kFrames; ++frame) {
    std::vector<Vec3> after = dance.VerticesAt(frame);
    for (std::size_t v = 0; v < after.size(); ++v) {
      const double moved = (after[v] - before[v]).norm();
      farthest = std::max(farthest, moved);
      sum += moved;
    }
    before = std::move(after);
  }
  EXPECT_LT(farthest, 0.060);
  EXPECT_GT(sum / (static_cast<double>(before.size()) * (kFrames - 1)), 0.005);
}

TEST(Dance, JointsBendTheHemTrailsAndTheCageSwings) {
  double least_elbow = 10, most_elbow = 0, least_knee = 10, most_knee = 0, lowest_hand = 10, highest_hand = 0;
  for (int frame = 0; frame < kFrames; ++frame) {
    const Pose pose = PoseAt(frame / 25.0);
    const double elbow = pose[kLeftUpperArm].rotation.angularDistance(pose[kLeftForearm].rotation);
    const double knee = pose[kLeftThigh].rotation.angularDistance(pose[kLeftShin].rotation);
    const double hand = (pose[kLeftHand] * RestJoints()[kLeftHand]).y();
    least_elbow = std::min(least_elbow, elbow), most_elbow = std::max(most_elbow, elbow);
    least_knee = std::min(least_knee, knee), most_knee = std::max(most_knee, knee);
    lowest_hand = std::min(lowest_hand, hand), highest_hand = std::max(highest_hand, hand);
  }
  EXPECT_GT(most_elbow - least_elbow, 0.35);
  EXPECT_GT(most_knee - least_knee, 0.5);
  EXPECT_GT(highest_hand - lowest_hand, 0.7);

  SwingingSkirt skirt(-3);
  SwingingCage cage(-3);
  double least_twist = 10, most_twist = -10, most_lean = 0;
  for (int frame = 0; frame < kFrames; ++frame) {
    skirt.AdvanceTo(frame / 25.0);
    cage.AdvanceTo(frame / 25.0);
    const double twist = skirt.Shape().hem_twist_rad;
    least_twist = std::min(least_twist, twist), most_twist = std::max(most_twist, twist);
    most_lean = std::max(most_lean, std::acos((cage.WorldFromCage(frame / 25.0).rotation * Vec3::UnitY()).y()));
  }
  EXPECT_GT(most_twist - least_twist, 0.1);
  EXPECT_GT(most_lean, 0.08);
  EXPECT_LT(most_lean, 0.8);
}

TEST(Dance, BonesStayTogetherAndPlantedFeetStayPut) {
  for (int i = 0; i < 600; ++i) {
    const Pose pose = PoseAt(i / 100.0), later = PoseAt((i + 1) / 100.0);
    for (std::int32_t bone = 1; bone < kBones; ++bone) {
      const Vec3& joint = RestJoints()[static_cast<std::size_t>(bone)];
      const double gap = (pose[static_cast<std::size_t>(bone)] * joint - pose[static_cast<std::size_t>(ParentOf(bone))] * joint).norm();
      EXPECT_LT(gap, 1e-9) << bone << " at " << i;
    }
    const auto moved = [&](std::size_t foot) { return (later[foot] * RestJoints()[foot] - pose[foot] * RestJoints()[foot]).norm(); };
    EXPECT_LT(std::min(moved(kLeftFoot), moved(kRightFoot)), 1e-4) << i;  // one foot stands at any time
  }
}

TEST(Dance, TheCageHangsFree) {
  const Dance& dance = SixSeconds();
  const std::size_t end = dance.surface().vertices.size();
  for (std::int32_t frame = 0; frame < kFrames; frame += 6) {
    const std::vector<Vec3> vertices = dance.VerticesAt(frame);
    const ClosestPoint dancer(Shell(dance, vertices, 0, dance.cage_begin()));
    double nearest = 1e9;
    for (std::size_t v = dance.cage_begin(); v < end; ++v) nearest = std::min(nearest, dancer.Distance(vertices[v]));
    EXPECT_GT(nearest, 0.030) << frame;
  }
}

TEST(Dance, LegsStayUnderTheSkirtAndArmsOutOfIt) {
  const Dance& dance = SixSeconds();
  for (const std::int32_t frame : {8, 60, 110, 145}) {
    const std::vector<Vec3> vertices = dance.VerticesAt(frame);
    geometry::Box3 box;
    for (const Vec3& x : vertices) box.extend(x);
    DepthScanner scanner(dance.surface(), box, {});
    const std::vector<char> seen = scanner.Seen(vertices);
    const ClosestPoint skirt(Shell(dance, vertices, dance.skirt_begin(), dance.cage_begin()));
    for (std::size_t v = 0; v < dance.skirt_begin(); ++v) {
      const auto part = static_cast<Part>(dance.part()[v]);
      if (part == Part::kLeftLeg || part == Part::kRightLeg) {
        EXPECT_FALSE(seen[v] && vertices[v].y() > 0.70) << frame;  // the hem hangs at about 0.55 m, and lifts when it swings
      }
      if (part == Part::kLeftArm || part == Part::kRightArm) {
        EXPECT_GT(skirt.Distance(vertices[v]), 0.03) << frame;
      }
    }
  }
}

TEST(Dance, IsTheSameAtTheSameTimeWhateverTheFrameRate) {
  const Dance faster(13, 50);
  const Dance& dance = SixSeconds();
  const std::vector<Vec3> a = dance.VerticesAt(6), b = faster.VerticesAt(12);
  ASSERT_EQ(a.size(), b.size());
  for (std::size_t v = 0; v < a.size(); ++v) ASSERT_LT((a[v] - b[v]).norm(), 1e-9);
}

}  // namespace
}  // namespace vorocast::synth
