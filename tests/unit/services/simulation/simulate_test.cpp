// SPDX-License-Identifier: AGPL-3.0-or-later
#include "services/simulation/simulate.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "services/base/digest.h"
#include "services/simulation/effect.h"
#include "services/simulation/pendulum.h"
#include "tests/unit/services/simulation/synthetic_take.h"

namespace vorocast::simulation {
namespace {

using geometry::Cells;
using geometry::CellState;
using geometry::Quat;
using geometry::Rigid3;
using geometry::SimulatedTake;
using geometry::TrackedTake;
using geometry::Vec3;
using nlohmann::json;
using testing::Animate;
using testing::CubeBlock;

SimulatedTake Simulated(const TrackedTake& take, json effect) {
  effect["name"] = "test";
  auto result = Simulate(take, effect, {});
  EXPECT_TRUE(result.ok()) << result.status();
  return result.ok() ? *std::move(result) : SimulatedTake{};
}

Rigid3 PoseOf(const SimulatedTake& take, std::size_t n, std::size_t s, std::size_t c) {
  const Eigen::Vector4f& q = take.cell_rotation[s * n + c];
  return {Quat(q[0], q[1], q[2], q[3]).normalized(), take.cell_translation[s * n + c]};
}

Vec3 Centroid(const SimulatedTake& result, const Cells& cells, std::size_t s, std::size_t c) {
  return PoseOf(result, cells.size(), s, c) * cells.centroid[c];
}

/// The lowest corner of a cell.
double Lowest(const SimulatedTake& result, const Cells& cells, std::size_t s, std::size_t c) {
  double lowest = 1e9;
  const Rigid3 pose = PoseOf(result, cells.size(), s, c);
  for (auto f = cells.face_offset[c]; f < cells.face_offset[c + 1]; ++f) {
    for (auto i = cells.vertex_offset[f]; i < cells.vertex_offset[f + 1]; ++i)
      lowest = std::min(lowest, (pose * cells.vertices[cells.vertex[i]]).y());
  }
  return lowest;
}

std::string Digest(const SimulatedTake& result) {
  base::Hasher hasher;
  const auto add = [&](const auto& values) { hasher.Update({reinterpret_cast<const char*>(values.data()), values.size() * sizeof(values[0])}); };
  add(result.time);
  add(result.cell_rotation);
  add(result.cell_translation);
  add(result.cell_state);
  for (const Rigid3& pose : result.object_pose) {
    add(pose.translation);
    add(pose.rotation.coeffs());
  }
  return hasher.Finish().Hex();
}

const json kReleaseAll = {{{"by", "height"}, {"start_s", 0}, {"end_s", 0}}};

/// Largest distance of any recalled cell's corners' sphere from its tracked pose, over all frames.
double Drift(const SimulatedTake& result, const TrackedTake& take) {
  double drift = 0;
  for (std::size_t s = 0; s < take.frame_count(); ++s) {
    for (std::size_t c = 0; c < take.cell_count(); ++c) {
      const Rigid3 truth = take.CellPose(s, c);
      const Rigid3 pose = PoseOf(result, take.cell_count(), s, c);
      const Vec3& centroid = take.model.cells.centroid[c];
      drift = std::max({drift, (pose * centroid - truth * centroid).norm(), 0.02 * pose.rotation.angularDistance(truth.rotation)});
    }
  }
  return drift;
}

TEST(Simulate, NothingMovesWhenEverythingIsRecalledAtRest) {
  const TrackedTake take = Animate(testing::Person(300), 20, 25, testing::Still);
  const SimulatedTake result = Simulated(take, json::object());
  EXPECT_LT(Drift(result, take), 1e-7);
  for (std::size_t s = 1; s < result.time.size(); ++s) {
    for (std::size_t c = 0; c < take.cell_count(); ++c)
      EXPECT_LT((result.cell_translation[s * take.cell_count() + c] - result.cell_translation[c]).norm(), 1e-12);
  }
}

TEST(Simulate, RecalledCellsFollowTheirMotion) {
  const TrackedTake take = Animate(testing::Person(300), 30, 25, testing::Sway);
  EXPECT_LT(Drift(Simulated(take, json::object()), take), 1e-6);
}

/// The cells near a fixed object are simulated, not replayed, and still stand where they should.
TEST(Simulate, NoDriftNextToSomethingThatDoesNotTouch) {
  const TrackedTake take = Animate(CubeBlock(4, 10, 4, 0.04), 40, 25, testing::Still);
  const json box = {{"kind", "box"}, {"position_m", {0.0, 0.2, 0.185}}, {"size_m", {0.3, 0.3, 0.2}}, {"motion", "fixed"}};  // 5 mm away
  const SimulatedTake result = Simulated(take, {{"objects", {box}}, {"rupture", {{"acceleration_m_s2", 1}}}});
  EXPECT_LT(Drift(result, take), 1e-6);
  EXPECT_EQ(std::ranges::count(result.cell_state, CellState::kReleased), 0);
}

TEST(Simulate, StoredTimesAndShapes) {
  const TrackedTake take = Animate(CubeBlock(2, 2, 2, 0.04), 11, 25, testing::Still);
  const json sphere = {{"kind", "sphere"}, {"position_m", {1, 1, 0}}, {"motion", "fixed"}};
  const SimulatedTake result = Simulated(take, {{"duration_s", 1}, {"output_fps", 50}, {"objects", {sphere}}});
  ASSERT_EQ(result.time.size(), 51U);
  EXPECT_EQ(result.time[0], 0);
  EXPECT_NEAR(result.time[50], 1, 1e-12);
  EXPECT_EQ(result.cell_rotation.size(), 51U * 8);
  EXPECT_EQ(result.cell_translation.size(), 51U * 8);
  EXPECT_EQ(result.cell_state.size(), 51U * 8);
  ASSERT_EQ(result.objects.size(), 1U);
  EXPECT_EQ(result.object_pose.size(), 51U);
  EXPECT_EQ(result.objects[0].name, "sphere");
  EXPECT_LT((result.object_pose[50].translation - Vec3(1, 1, 0)).norm(), 1e-6);
  const json stored = json::parse(result.effect_json);
  EXPECT_EQ(stored, *NormaliseEffect(stored));
}

/// ½ g t², to what the integrator's step is worth: it adds g dt t / 2.
TEST(Simulate, AReleasedCellFallsFreely) {
  const TrackedTake take = Animate(CubeBlock(1, 1, 1, 0.04, 100), 26, 25, testing::Still);
  const SimulatedTake result = Simulated(take, {{"release", kReleaseAll}, {"ground", {{"enabled", false}}}, {"rate_hz", 1000}});
  for (std::size_t s = 0; s < result.time.size(); ++s) {
    const double t = result.time[s];
    const double fallen = 100.02 - Centroid(result, take.model.cells, s, 0).y();
    EXPECT_NEAR(fallen, 0.5 * 9.81 * t * t, 0.5 * 9.81 * t * 0.0134 + 1e-4) << t;
    EXPECT_EQ(result.cell_state[s], s == 0 ? CellState::kRecalled : CellState::kReleased);
  }
}

TEST(Simulate, AReleasedCellKeepsTheVelocityOfItsMotion) {
  const TrackedTake take = Animate(CubeBlock(1, 1, 1, 0.04, 50), 51, 25, [](const Vec3& centre, double t) {
    const Quat turn(Eigen::AngleAxisd(1.5 * t, Vec3::UnitY()));
    return Rigid3{turn, Vec3(centre + Vec3(2 * t, 0, -t) - turn * centre)};
  });
  const SimulatedTake result =
      Simulated(take, {{"release", {{{"by", "height"}, {"start_s", 1}, {"end_s", 1}}}}, {"gravity_m_s2", 0}, {"ground", {{"enabled", false}}}});
  for (std::size_t s = 0; s < result.time.size(); ++s) {
    EXPECT_LT((Centroid(result, take.model.cells, s, 0) - Vec3(2 * result.time[s], 50.02, -result.time[s])).norm(), 2e-4);
  }
  // Its spin goes on too, but for Bullet's angular damping of a fifth a second.
  const double turned = PoseOf(result, 1, 50, 0).rotation.angularDistance(PoseOf(result, 1, 25, 0).rotation);
  EXPECT_GT(turned, 1.5 * 0.85);
  EXPECT_LT(turned, 1.5 * 1.001);
}

TEST(Simulate, CellsGoInOrderFromTopToBottom) {
  const TrackedTake take = Animate(CubeBlock(2, 10, 2, 0.04), 51, 25, testing::Still);
  const SimulatedTake result = Simulated(take, {{"release", {{{"by", "height"}, {"from", "top"}, {"start_s", 0.5}, {"end_s", 1.5}}}}});
  const std::size_t n = take.cell_count();
  std::vector<double> released(n, 1e9);
  for (std::size_t s = 0; s < result.time.size(); ++s) {
    for (std::size_t c = 0; c < n; ++c) {
      if (result.cell_state[s * n + c] == CellState::kReleased) released[c] = std::min(released[c], result.time[s]);
    }
  }
  for (std::size_t c = 0; c < n; ++c) {
    const double due = 1.5 - (take.model.cells.centroid[c].y() - 0.02) / 0.36;
    EXPECT_GE(released[c], due - 1e-9);
    EXPECT_LE(released[c], due + 0.04 + 1e-9 + 0.04);
  }
}

TEST(Simulate, APileComesToRestOnTheGround) {
  const TrackedTake take = Animate(testing::Person(400), 26, 25, testing::Still);
  const SimulatedTake result = Simulated(take, {{"release", kReleaseAll}, {"duration_s", 4}});
  const std::size_t n = take.cell_count();
  const std::size_t last = result.time.size() - 1;
  double ground = 1e9;
  for (std::size_t c = 0; c < n; ++c) ground = std::min(ground, Lowest(result, take.model.cells, 0, c));
  double highest = -1e9;
  double fastest = 0;
  for (std::size_t c = 0; c < n; ++c) {
    EXPECT_GT(Lowest(result, take.model.cells, last, c), ground - 0.004) << c;
    highest = std::max(highest, Centroid(result, take.model.cells, last, c).y());
    fastest = std::max(fastest, 25 * (Centroid(result, take.model.cells, last, c) - Centroid(result, take.model.cells, last - 1, c)).norm());
  }
  EXPECT_LT(highest, ground + 0.6);  // it was 1.75 m
  EXPECT_GT(highest, ground + 0.05);
  EXPECT_LT(fastest, 0.3);
  // Solid lumps cannot share their middles.
  for (std::size_t a = 0; a < n; ++a) {
    for (std::size_t b = a + 1; b < n; ++b) {
      EXPECT_GT((Centroid(result, take.model.cells, last, a) - Centroid(result, take.model.cells, last, b)).norm(),
                0.025);  // the cells are 6 cm across
    }
  }
}

TEST(Simulate, RuptureOnlyWhereItIsHit) {
  const TrackedTake take = Animate(CubeBlock(4, 20, 10, 0.04), 51, 25, testing::Still);
  const json pendulum = {{"kind", "pendulum"}, {"radius_m", 0.07}, {"arm_m", 2}, {"hit_time_s", 1}, {"hit_height", 0.6}, {"heading_deg", 0}};
  const SimulatedTake result = Simulated(take, {{"objects", {pendulum}}, {"rupture", {{"acceleration_m_s2", 120}}}});
  const std::size_t n = take.cell_count();
  const Cells& cells = take.model.cells;
  const double height = 0.02 + 0.6 * 0.76;
  std::size_t torn = 0;
  for (std::size_t c = 0; c < n; ++c) {
    const bool released = result.cell_state[(result.time.size() - 1) * n + c] == CellState::kReleased;
    const double off = std::hypot(cells.centroid[c].y() - height, cells.centroid[c].z());
    if (off < 0.04) {
      EXPECT_TRUE(released) << cells.centroid[c].transpose();
    }  // in the ball's way
    if (off > 0.22) {
      EXPECT_FALSE(released) << cells.centroid[c].transpose();
    }
    torn += released;
    for (std::size_t s = 0; s < 15; ++s) EXPECT_EQ(result.cell_state[s * n + c], CellState::kRecalled);  // before the hit
  }
  EXPECT_GT(torn, 12U);
  EXPECT_LT(torn, n / 2);
  // For good: no torn cell is ever recalled again.
  for (std::size_t s = 1; s < result.time.size(); ++s) {
    for (std::size_t c = 0; c < n; ++c) EXPECT_GE(result.cell_state[s * n + c], result.cell_state[(s - 1) * n + c]);
  }
  // What was pushed aside but not torn is back in place.
  for (std::size_t c = 0; c < n; ++c) {
    const double off = std::hypot(cells.centroid[c].y() - height, cells.centroid[c].z());
    if (off > 0.22 && cells.centroid[c].y() > height) {
      EXPECT_LT((Centroid(result, cells, result.time.size() - 1, c) - cells.centroid[c]).norm(), 0.002);
    }
  }
}

TEST(Simulate, NothingTearsWithoutAThreshold) {
  const TrackedTake take = Animate(CubeBlock(4, 10, 6, 0.04), 60, 25, testing::Still);
  const json pendulum = {{"kind", "pendulum"}, {"radius_m", 0.06}, {"arm_m", 1.5}, {"hit_time_s", 0.6}, {"heading_deg", 0}};
  const SimulatedTake result = Simulated(take, {{"objects", {pendulum}}});
  EXPECT_EQ(std::ranges::count(result.cell_state, CellState::kReleased), 0);
  // A spring has pulled everything back (the pendulum is on the far side by then).
  double away = 0;
  for (std::size_t c = 0; c < take.cell_count(); ++c)
    away = std::max(away, (Centroid(result, take.model.cells, 36, c) - take.model.cells.centroid[c]).norm());
  EXPECT_LT(away, 0.005);
}

/// Two cells rest on recalled ones: what the springs carry neither grows nor tears.
TEST(Simulate, RecalledCellsCarryALoadWithoutGainingEnergy) {
  const TrackedTake take = Animate(CubeBlock(3, 6, 3, 0.04), 100, 25, testing::Still);
  const SimulatedTake result = Simulated(
      take, {{"release", {{{"by", "height"}, {"start_s", 0.2}, {"end_s", 0.2}, {"share", 0.3}}}}, {"rupture", {{"acceleration_m_s2", 500}}}});
  const std::size_t n = take.cell_count();
  double early = 0;
  double late = 0;
  for (std::size_t c = 0; c < n; ++c) {
    if (result.cell_state[99 * n + c] != CellState::kRecalled) continue;
    for (std::size_t s = 10; s < 40; ++s) early = std::max(early, (Centroid(result, take.model.cells, s, c) - take.model.cells.centroid[c]).norm());
    for (std::size_t s = 70; s < 100; ++s) late = std::max(late, (Centroid(result, take.model.cells, s, c) - take.model.cells.centroid[c]).norm());
  }
  EXPECT_LT(early, 0.03);
  EXPECT_LE(late, std::max(early, 0.021));  // two cells' weight on k = 1000: 2 g / k
  EXPECT_EQ(std::ranges::count(result.cell_state.end() - static_cast<std::ptrdiff_t>(n), result.cell_state.end(), CellState::kReleased), 18);
}

TEST(Simulate, ALoosePendulumSwingsWithItsPeriod) {
  const TrackedTake take = Animate(CubeBlock(1, 1, 1, 0.04), 226, 25, testing::Still);
  const json pendulum = {{"kind", "pendulum"}, {"radius_m", 0.3},       {"arm_m", 1},        {"pivot_m", {10, 5, 0}},
                         {"heading_deg", 0},   {"start_angle_deg", 60}, {"hit_time_s", 0.8}, {"motion", "loose"}};
  const SimulatedTake result = Simulated(take, {{"objects", {pendulum}}, {"rate_hz", 2000}});
  const PendulumSwing truth(std::numbers::pi / 3, 9.81, EquivalentLength(1, 0.3), 0.8);
  std::vector<double> upward;  // passages through the lowest point in the first direction
  double last_angle = 0;
  double widest = 0;
  for (std::size_t s = 0; s < result.time.size(); ++s) {
    const Vec3 down = result.object_pose[s].rotation * -Vec3::UnitY();
    const double angle = std::atan2(down.x(), -down.y());
    if (s < 75) {
      EXPECT_NEAR(angle, truth.Angle(result.time[s]), 0.06) << result.time[s];  // two hundredths of a second at its fastest
    }
    if (s > 0 && last_angle < 0 && angle >= 0) upward.push_back(result.time[s] - 0.04 * angle / (angle - last_angle));
    last_angle = angle;
    widest = result.time[s] > 6 ? std::max(widest, std::abs(angle)) : 0;
  }
  ASSERT_GE(upward.size(), 4U);
  EXPECT_NEAR((upward.back() - upward.front()) / static_cast<double>(upward.size() - 1), truth.period(), 0.01 * truth.period());
  EXPECT_NEAR(widest, std::numbers::pi / 3, 0.1);  // the hinge takes a little at every step; it never adds
  EXPECT_LT(widest, std::numbers::pi / 3 + 1e-3);
}

TEST(Simulate, ADrivenPendulumIsWhereItsSwingSays) {
  const TrackedTake take = Animate(CubeBlock(2, 4, 2, 0.04), 51, 25, testing::Still);
  const json pendulum = {{"kind", "pendulum"}, {"arm_m", 1}, {"heading_deg", 90}, {"start_angle_deg", 40}, {"hit_time_s", 1}};
  const SimulatedTake result = Simulated(take, {{"objects", {pendulum}}});
  const PendulumSwing truth(2 * std::numbers::pi / 9, 9.81, EquivalentLength(1, 0.12), 1);
  for (std::size_t s = 0; s < result.time.size(); ++s) {
    const Vec3 down = result.object_pose[s].rotation * -Vec3::UnitY();
    EXPECT_NEAR(std::atan2(down.z(), -down.y()), truth.Angle(result.time[s]), 1e-6);
  }
}

TEST(Simulate, LooseObjectsFallLandAndRest) {
  const TrackedTake take = Animate(CubeBlock(1, 1, 1, 0.04), 76, 25, testing::Still);
  const json box = {{"kind", "box"}, {"position_m", {1, 0.5, 0}}, {"size_m", {0.2, 0.1, 0.3}}, {"start_s", 0.4}};
  const json sphere = {{"kind", "sphere"}, {"position_m", {-1, 0.5, 0}}, {"radius_m", 0.1}};
  const SimulatedTake result = Simulated(take, {{"objects", {box, sphere}}});
  EXPECT_NEAR(result.object_pose[2 * 9].translation.y(), 0.5, 1e-6);  // still held
  EXPECT_NEAR(result.object_pose[2 * 75].translation.y(), 0.05, 0.002);
  EXPECT_NEAR(result.object_pose[2 * 75 + 1].translation.y(), 0.1, 0.002);
}

TEST(Simulate, CellsThatFallOutOfTheSceneAreGone) {
  const TrackedTake take = Animate(CubeBlock(1, 2, 1, 0.04), 2, 25, testing::Still);
  const SimulatedTake result = Simulated(take, {{"release", kReleaseAll}, {"duration_s", 6}, {"ground", {{"enabled", false}}}});
  EXPECT_EQ(result.cell_state.back(), CellState::kGone);
  EXPECT_GT(Centroid(result, take.model.cells, result.time.size() - 1, 1).y(), -110);
}

TEST(Simulate, TheSameInputGivesTheSameBytes) {
  const TrackedTake take = Animate(testing::Person(250), 40, 25, testing::Sway);
  json effect = *LoadEffect("pendulum");
  effect["release"] = {{{"by", "height"}, {"start_s", 1.0}, {"end_s", 1.3}}};
  const auto first = Simulate(take, effect, {});
  // Other addresses, other history of the heap.
  std::vector<std::unique_ptr<std::vector<char>>> ballast;
  for (std::size_t i = 1; i < 2000; ++i) ballast.push_back(std::make_unique<std::vector<char>>(i % 700, 'x'));
  const auto second = Simulate(take, effect, {});
  ASSERT_TRUE(first.ok() && second.ok());
  EXPECT_EQ(Digest(*first), Digest(*second));
}

TEST(Simulate, DegenerateCellsDoNoHarm) {
  Cells cells = CubeBlock(3, 3, 3, 0.04);
  testing::Polyhedron flat = testing::CubeCell(0.04);
  for (Vec3& vertex : flat.vertices) vertex.x() = 0;
  flat.volume = 0;
  testing::AddCell(cells, flat, Vec3(0, 0.2, 0));
  testing::AddCell(cells, testing::CubeCell(1e-7), Vec3(0, 0.25, 0));
  testing::AddCell(cells, {}, Vec3(0, 0.3, 0));
  testing::AddCell(cells, testing::CubeCell(0.04), Vec3(0, 0.02, 0));  // wholly inside another
  const TrackedTake take = Animate(std::move(cells), 50, 25, testing::Still);
  const SimulatedTake result = Simulated(take, {{"release", kReleaseAll}});
  const std::size_t last = result.time.size() - 1;
  for (std::size_t c = 0; c < take.cell_count(); ++c) {
    const Vec3 place = Centroid(result, take.model.cells, last, c);
    EXPECT_TRUE(place.allFinite());
    EXPECT_GT(place.y(), -0.01);
    EXPECT_LT(place.norm(), 3);
  }
}

TEST(Simulate, ReportsProgressAndStopsWhenCancelled) {
  const TrackedTake take = Animate(CubeBlock(2, 2, 2, 0.04), 11, 25, testing::Still);
  std::vector<double> told;
  EXPECT_TRUE(Simulate(take, {{"name", "x"}}, [&](double fraction) { told.push_back(fraction); }).ok());
  EXPECT_TRUE(std::ranges::is_sorted(told));
  EXPECT_EQ(told.back(), 1);
  int asked = 0;
  const auto cancelled = Simulate(take, {{"name", "x"}}, {}, [&] { return ++asked == 3; });
  EXPECT_EQ(cancelled.status().code(), absl::StatusCode::kCancelled);
  EXPECT_EQ(asked, 3);
}

TEST(Simulate, RefusesABadEffectAndABadTake) {
  TrackedTake take = Animate(CubeBlock(1, 1, 1, 0.04), 3, 25, testing::Still);
  EXPECT_EQ(Simulate(take, {{"name", "x"}, {"speed", 1}}, {}).status().code(), absl::StatusCode::kInvalidArgument);
  take.cell_translation.pop_back();
  EXPECT_EQ(Simulate(take, {{"name", "x"}}, {}).status().code(), absl::StatusCode::kInvalidArgument);
}

}  // namespace
}  // namespace vorocast::simulation
