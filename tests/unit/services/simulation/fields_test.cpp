// SPDX-License-Identifier: AGPL-3.0-or-later
// Fields, distortion, colliders, vanishing and copies, as they come out of a whole run.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "services/simulation/effect.h"
#include "services/simulation/force_fields.h"
#include "services/simulation/simulate.h"
#include "tests/unit/services/simulation/synthetic_take.h"

namespace vorocast::simulation {
namespace {

using geometry::CellState;
using geometry::Quat;
using geometry::SimulatedTake;
using geometry::TrackedTake;
using geometry::Vec3;
using nlohmann::json;

TrackedTake Block(int x, int y, int z, double bottom, std::size_t frames) {
  testing::Cells cells = testing::CubeBlock(x, y, z, 0.04, bottom);
  testing::ConnectNeighbours(cells);
  return testing::Animate(std::move(cells), frames, 50, testing::Still);
}

SimulatedTake Simulated(const TrackedTake& take, json effect) {
  effect["name"] = "test";
  auto result = Simulate(take, effect, {});
  EXPECT_TRUE(result.ok()) << result.status();
  return result.ok() ? *std::move(result) : SimulatedTake{};
}

Quat Rotation(const Eigen::Vector4f& q) { return Quat(q[0], q[1], q[2], q[3]).normalized(); }
Vec3 Centre(const SimulatedTake& result, const TrackedTake& take, std::size_t s, std::size_t c) {
  const std::size_t i = s * take.cell_count() + c;
  return Rotation(result.cell_rotation[i]) * take.model.cells.centroid[c] + result.cell_translation[i];
}

const json kAtOnce = {{{"by", "height"}, {"start_s", 0}, {"end_s", 0}}};
const json kEmpty = {{"gravity_m_s2", 0}, {"ground", {{"enabled", false}}}};

/// dv/dt = c (w − v): v = w (1 − e^−ct).
TEST(Fields, WindCarriesAsDragSays) {
  const TrackedTake take = Block(1, 1, 1, 1, 51);
  json effect = kEmpty;
  effect["release"] = kAtOnce;
  effect["rate_hz"] = 1000;
  effect["fields"] = {{{"kind", "wind"}, {"velocity_m_s", {3, 0, 0}}, {"drag_s", 2}, {"turbulence", 0}}};
  const SimulatedTake result = Simulated(take, effect);
  for (std::size_t s = 0; s < result.time.size(); ++s) {
    const double t = result.time[s];
    EXPECT_NEAR(Centre(result, take, s, 0).x(), 3 * (t - (1 - std::exp(-2 * t)) / 2), 0.02) << t;
  }
}

TEST(Fields, AnAttractorPullsWithItsStrengthAndKeyFrames) {
  const TrackedTake take = Block(1, 1, 1, 1, 51);
  json effect = kEmpty;
  effect["release"] = kAtOnce;
  effect["fields"] = {{{"kind", "attractor"},
                       {"origin", "world"},
                       {"position_m", {50, 1.02, 0}},
                       {"strength_m_s2", {{{"t", 0}, {"value", 0}}, {{"t", 1}, {"value", 6}}}},
                       {"drag_s", 0}}};
  const SimulatedTake result = Simulated(take, effect);
  for (std::size_t s = 0; s < result.time.size(); ++s) {
    const double t = result.time[s];
    EXPECT_NEAR(Centre(result, take, s, 0).x(), t * t * t, 0.02) << t;  // a = 6 t
  }
}

/// A recalled cell gives way by strength / stiffness; with a mask by as much of it.
TEST(Fields, RecalledCellsGiveWayAndComeBack) {
  const TrackedTake take = Block(1, 4, 1, 0, 151);
  json effect = kEmpty;
  effect["recall"] = {{"stiffness_s2", 500}};
  effect["fields"] = {{{"kind", "attractor"},
                       {"origin", "world"},
                       {"position_m", {1000, 0, 0}},
                       {"strength_m_s2", {{{"t", 1}, {"value", 10}}, {{"t", 1.5}, {"value", 0}}}},
                       {"drag_s", 0},
                       {"mask", {{"height", {0.6, 1}}}}}};
  const SimulatedTake result = Simulated(take, effect);
  for (std::size_t c = 0; c < 4; ++c) {
    const Vec3 moved = Centre(result, take, 49, c) - take.model.cells.centroid[c];
    EXPECT_NEAR(moved.x(), c >= 2 ? 0.02 : 0, 1e-4);
    EXPECT_LT((Centre(result, take, 150, c) - take.model.cells.centroid[c]).norm(), 1e-5);
  }
}

TEST(Fields, APullTearsWhatIsHeldTooWeakly) {
  const TrackedTake take = Block(1, 4, 1, 0, 51);
  json effect = kEmpty;
  effect["rupture"] = {{"acceleration_m_s2", 30}, {"mask", {{"height", {0.6, 1}}}}};
  effect["fields"] = {{{"kind", "attractor"}, {"position_m", {1, 2, 0}}, {"strength_m_s2", 60}}};
  const SimulatedTake result = Simulated(take, effect);
  for (std::size_t c = 0; c < 4; ++c) EXPECT_EQ(result.cell_state[50 * 4 + c], c >= 2 ? CellState::kReleased : CellState::kRecalled);
}

/// Turbulence has no divergence, and the strength that it claims.
TEST(Fields, TurbulenceIsIncompressible) {
  const double h = 1e-5;
  double square = 0;
  for (int i = 0; i < 2000; ++i) {
    const Vec3 x(0.731 * i, 0.377 * i, 0.119 * i);
    double divergence = 0;
    for (int axis = 0; axis < 3; ++axis)
      divergence += (Turbulence(x + h * Vec3::Unit(axis), 0.3)[axis] - Turbulence(x - h * Vec3::Unit(axis), 0.3)[axis]) / (2 * h);
    EXPECT_NEAR(divergence, 0, 1e-4);
    square += Turbulence(x, 0.01 * i).squaredNorm() / 2000;
  }
  EXPECT_NEAR(square, 1, 0.1);
}

TEST(Distortion, ATwistTurnsTheTopAndNotTheFoot) {
  const TrackedTake take = Block(3, 11, 3, 0, 51);
  const SimulatedTake result = Simulated(
      take, {{"distortion",
              {{{"kind", "twist"}, {"angle_deg", {{{"t", 0}, {"value", 0}}, {{"t", 1}, {"value", 90}}}}, {"from_m", 0.02}, {"to_m", 0.42}}}}});
  const std::size_t n = take.cell_count();
  for (std::size_t c = 0; c < n; ++c) {
    const Vec3 x = take.model.cells.centroid[c];
    const Quat turn(Eigen::AngleAxisd(0.5 * std::numbers::pi * (x.y() - 0.02) / 0.4, Vec3::UnitY()));
    EXPECT_LT((Centre(result, take, 50, c) - turn * x).norm(), 1e-6);
    EXPECT_LT(Rotation(result.cell_rotation[50 * n + c]).angularDistance(turn), 1e-6);
    EXPECT_LT((Centre(result, take, 0, c) - x).norm(), 1e-7);
  }
}

TEST(Distortion, SwellAndWaveMoveCellsAsTheySay) {
  const TrackedTake take = Block(3, 5, 3, 0, 26);
  const SimulatedTake swollen = Simulated(take, {{"distortion", {{{"kind", "swell"}, {"horizontal", 2}, {"vertical", 1.5}}}}});
  const SimulatedTake waving =
      Simulated(take, {{"distortion", {{{"kind", "wave"}, {"amplitude_m", {0.1, 0, 0}}, {"length_m", 0.4}, {"frequency_hz", 2}}}}});
  for (std::size_t c = 0; c < take.cell_count(); ++c) {
    const Vec3 x = take.model.cells.centroid[c];
    EXPECT_LT((Centre(swollen, take, 5, c) - Vec3(2 * x.x(), 1.5 * x.y(), 2 * x.z())).norm(), 1e-6);
    const double phase = 2 * std::numbers::pi * (x.y() / 0.4 - 2 * waving.time[13]);
    EXPECT_LT((Centre(waving, take, 13, c) - x - Vec3(0.1 * std::sin(phase), 0, 0)).norm(), 1e-6);
  }
}

TEST(Colliders, ADrivenBoxFollowsItsKeysAndPushes) {
  const TrackedTake take = Block(3, 3, 3, 0, 101);
  const json ram = {{"kind", "box"},
                    {"size_m", {0.2, 0.2, 0.2}},
                    {"position_m", {{{"t", 0}, {"value", {-0.5, 0.1, 0}}}, {{"t", 2}, {"value", {0.5, 0.1, 0}}}}},
                    {"rotation_deg", {{{"t", 0}, {"value", {0, 0, 0}}}, {{"t", 2}, {"value", {0, 90, 0}}}}},
                    {"motion", "driven"}};
  const SimulatedTake result = Simulated(take, {{"objects", {ram}}, {"release", kAtOnce}});
  for (std::size_t s = 0; s <= 100; s += 10) {
    EXPECT_NEAR(result.object_pose[s].translation.x(), -0.5 + 0.5 * result.time[s], 1e-6);
    EXPECT_NEAR(result.object_pose[s].rotation.angularDistance(Quat::Identity()), 0.25 * std::numbers::pi * result.time[s], 1e-6);
  }
  // It has swept the ground in front of it: nothing is left in its way.
  for (std::size_t c = 0; c < take.cell_count(); ++c) {
    const Vec3 x = Centre(result, take, 100, c);
    EXPECT_FALSE(x.x() < 0.38 && std::abs(x.z()) < 0.08 && x.y() < 0.2) << x.transpose();
  }
  EXPECT_LT(result.object_penetration_m, 0.02);
}

/// A table made of triangles: a few cells that fall from a hand's width land on it.
TEST(Colliders, CellsLandOnAMesh) {
  const TrackedTake take = Block(2, 2, 2, 0.6, 101);
  const json table = {{"kind", "mesh"},
                      {"vertices", {{-1, 0.3, -1}, {-1, 0.3, 1}, {1, 0.3, 1}, {1, 0.3, -1}, {-1, 0.2, -1}, {-1, 0.2, 1}, {1, 0.2, 1}, {1, 0.2, -1}}},
                      {"triangles", json::parse("[[0,1,2],[0,2,3],[4,6,5],[4,7,6],[0,4,5],[0,5,1],[1,5,6],[1,6,2],[2,6,7],[2,7,3],[3,7,4],[3,4,0]]")},
                      {"position_m", {0, 0, 0}},
                      {"origin", "world"},
                      {"motion", "fixed"}};
  const SimulatedTake result = Simulated(take, {{"objects", {table}}, {"release", kAtOnce}, {"ground", {{"height_m", 0}}}});
  for (std::size_t c = 0; c < take.cell_count(); ++c) EXPECT_GT(Centre(result, take, 100, c).y(), 0.3) << c;
  EXPECT_LT(result.object_penetration_m, 0.03);
}

TEST(Colliders, AWallStandsOnItsFootAndStopsABall) {
  const TrackedTake take = Block(2, 2, 2, 0, 101);
  const json wall = {{"kind", "wall"}, {"position_m", {1, 0, 0}}, {"thickness_m", 0.2}, {"height_m", 2}};
  const json ball = {{"kind", "sphere"}, {"position_m", {0.4, 0.5, 0}}, {"velocity_m_s", {8, 0, 0}}, {"radius_m", 0.1}};
  const SimulatedTake result = Simulated(take, {{"objects", {wall, ball}}});
  EXPECT_LT((result.object_pose[0].translation - Vec3(1, 1, 0)).norm(), 1e-6);
  double farthest = 0;
  for (std::size_t s = 0; s < result.time.size(); ++s) farthest = std::max(farthest, result.object_pose[2 * s + 1].translation.x());
  EXPECT_GT(farthest, 0.7);
  EXPECT_LT(farthest, 0.83);  // 1 − half the wall − its radius
}

TEST(Vanishing, CellsShrinkAndAreGone) {
  const TrackedTake take = Block(5, 5, 5, 0, 101);
  const SimulatedTake result =
      Simulated(take, {{"release", {{{"by", "depth"}, {"start_s", 0.2}, {"speed_m_s", 0.1}, {"action", "vanish"}, {"vanish_s", 0.3}}}}});
  const std::size_t n = take.cell_count();
  ASSERT_EQ(result.cell_scale.size(), result.cell_state.size());
  for (std::size_t s = 0; s < result.time.size(); ++s) {
    for (std::size_t c = 0; c < n; ++c) {
      const double due = 0.2 + take.model.cells.depth[c] / 0.1;
      EXPECT_NEAR(result.cell_scale[s * n + c], std::clamp(1 - (result.time[s] - due) / 0.3, 0.0, 1.0), 1e-5);
      if (result.time[s] > due + 0.32) {
        EXPECT_EQ(result.cell_state[s * n + c], CellState::kGone);
      }
      if (result.time[s] < due + 0.3) {
        EXPECT_EQ(result.cell_state[s * n + c], CellState::kRecalled);
      }
    }
  }
  EXPECT_TRUE(Simulated(take, {}).cell_scale.empty());
}

/// Copies of something that moves at 1 m/s: a copy's place is where its own, slower time has it.
TEST(Persistence, CopiesGoOnInSlowerTimeWearAwayAndVanish) {
  testing::Cells cells = testing::CubeBlock(3, 3, 3, 0.04);
  testing::ConnectNeighbours(cells);
  const TrackedTake take = testing::Animate(std::move(cells), 151, 50, [](const Vec3&, double t) {
    return geometry::Rigid3{Quat::Identity(), Vec3(t, 0, 0)};
  });
  const SimulatedTake result = Simulated(take, {{"persistence",
                                                 {{{"start_s", 0.5},
                                                   {"end_s", 1.6},
                                                   {"interval_s", 1},
                                                   {"lifetime_s", 1.2},
                                                   {"speed", {{{"t", 0}, {"value", 1}}, {{"t", 0.8}, {"value", 0}}}},
                                                   {"drift_m_s", {0, 0, 0.5}},
                                                   {"erode_start_s", 0.4},
                                                   {"vanish_s", 0.2}}}}});
  const geometry::CellCopies& copies = result.copies;
  ASSERT_EQ(copies.offset.size(), result.time.size() + 1);
  const std::vector<double>& depth = take.model.cells.depth;
  for (std::size_t s = 0; s < result.time.size(); ++s) {
    std::array<std::size_t, 2> seen{};
    for (auto i = static_cast<std::size_t>(copies.offset[s]); i < static_cast<std::size_t>(copies.offset[s + 1]); ++i) {
      ASSERT_LT(copies.copy[i], 2);
      ++seen[static_cast<std::size_t>(copies.copy[i])];
      const double age = result.time[s] - 0.5 - copies.copy[i];
      const double own = age < 0.8 ? age - age * age / 1.6 : 0.4;
      const auto c = static_cast<std::size_t>(copies.cell[i]);
      const Vec3 place = Rotation(copies.rotation[i]) * take.model.cells.centroid[c] + copies.translation[i].cast<double>();
      EXPECT_LT((place - take.model.cells.centroid[c] - Vec3(0.5 + copies.copy[i] + own, 0, 0.5 * age)).norm(), 1e-4);
      const double due = 0.4 + depth[c] / 0.06 * 0.6;
      EXPECT_NEAR(copies.scale[i], std::clamp(1 - (age - due) / 0.2, 0.0, 1.0), 1e-4);
    }
    for (const std::size_t k : {0U, 1U}) {
      const double age = result.time[s] - 0.5 - static_cast<double>(k);
      if (age > 0.01 && age < 0.4) {
        EXPECT_EQ(seen[k], 27U) << age;
      }
      if (age < 0 || age > 1.2) {
        EXPECT_EQ(seen[k], 0U);
      }
    }
  }
}

TEST(Combined, EverythingAtOnceIsTheSameOnEveryRun) {
  testing::Cells cells = testing::CubeBlock(4, 8, 4, 0.04);
  testing::ConnectNeighbours(cells);
  const TrackedTake take = testing::Animate(std::move(cells), 41, 25, testing::Sway);
  const json ram = {
      {"kind", "box"}, {"position_m", {{{"t", 0}, {"value", {-0.6, 0.1, 0}}}, {{"t", 1}, {"value", {0.1, 0.1, 0}}}}}, {"motion", "driven"}};
  const json effect = {{"release", {{{"by", "heat"}, {"rate_s", 60}}, {{"by", "depth"}, {"start_s", 1}, {"action", "vanish"}}}},
                       {"rupture", {{"acceleration_m_s2", 100}}},
                       {"fields", {{{"kind", "wind"}}, {{"kind", "attractor"}}}},
                       {"distortion", {{{"kind", "twist"}}, {{"kind", "wave"}}}},
                       {"bonds", {{"between", "all"}, {"break_stretch", 0.4}}},
                       {"persistence", {json::object()}},
                       {"objects", {ram}}};
  const SimulatedTake a = Simulated(take, effect);
  const SimulatedTake b = Simulated(take, effect);
  EXPECT_EQ(a.cell_state, b.cell_state);
  EXPECT_EQ(a.cell_translation, b.cell_translation);
  EXPECT_EQ(a.cell_rotation, b.cell_rotation);
  EXPECT_EQ(a.cell_scale, b.cell_scale);
  EXPECT_EQ(a.copies.translation, b.copies.translation);
  for (const Vec3& x : a.cell_translation) ASSERT_LT(x.norm(), 50);
}

}  // namespace
}  // namespace vorocast::simulation
