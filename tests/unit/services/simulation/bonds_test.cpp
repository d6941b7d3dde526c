// SPDX-License-Identifier: AGPL-3.0-or-later
#include "services/simulation/bonds.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>

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

Vec3 Centre(const SimulatedTake& result, const TrackedTake& take, std::size_t s, std::size_t c) {
  const Eigen::Vector4f& q = result.cell_rotation[s * take.cell_count() + c];
  return Quat(q[0], q[1], q[2], q[3]).normalized() * take.model.cells.centroid[c] + result.cell_translation[s * take.cell_count() + c];
}

const json kAtOnce = {{{"by", "height"}, {"start_s", 0}, {"end_s", 0}}};

/// One bond between two bodies in empty space: the pair swings with √(k) of the reduced mass, and keeps its momentum.
TEST(Bonds, TwoBodiesSwingAsASpringDoes) {
  const TrackedTake take = Block(2, 1, 1, 0, 2);
  const TrackedMotion motion(take);
  const MaskSubject subject(take.model, motion, Vec3::Zero());
  const BondSettings settings{.between = BondSettings::Between::kReleased, .stiffness_s2 = 400, .damping_ratio = 0};
  Bonds bonds(settings, take.model.cells, subject);
  std::vector<Bonds::Body> bodies(2);
  const double mass[2] = {1, 3};
  for (std::size_t c = 0; c < 2; ++c) {
    bodies[c] = {
        .state = Bonds::Body::State::kReleased, .position = motion.AtFrame(0)[c].translation, .inverse_mass = 1 / mass[c], .inverse_inertia = 1e4};
    bodies[c].target = motion.AtFrame(0)[c];
  }
  bodies[1].position.x() += 0.01;
  const double dt = 1e-4;
  double crossed = 0;
  for (int i = 1; i <= 1000 && crossed == 0; ++i) {
    bonds.Solve(i * dt, dt, bodies);
    for (Bonds::Body& body : bodies) body.position += dt * body.velocity;
    if (bodies[1].position.x() - bodies[0].position.x() < 0.04) crossed = i * dt;
    EXPECT_LT((mass[0] * bodies[0].velocity + mass[1] * bodies[1].velocity).norm(), 1e-12);
  }
  EXPECT_NEAR(crossed, 0.5 * std::numbers::pi / 20, 0.002);  // a quarter of 2π/√400
}

TEST(Bonds, ABondedBodyFallsAsOneAndKeepsItsShape) {
  const TrackedTake take = Block(4, 6, 4, 2, 26);
  const SimulatedTake result = Simulated(take, {{"release", kAtOnce}, {"ground", {{"enabled", false}}}, {"bonds", {{"between", "released"}}}});
  for (const std::size_t s : {10U, 25U}) {
    const double fallen = take.model.cells.centroid[0].y() - Centre(result, take, s, 0).y();
    EXPECT_NEAR(fallen, 0.5 * 9.81 * result.time[s] * result.time[s], 0.5 * 9.81 * result.time[s] / 50);
    for (std::size_t c = 1; c < take.cell_count(); ++c) {
      const Vec3 was = take.model.cells.centroid[c] - take.model.cells.centroid[0];
      EXPECT_LT((Centre(result, take, s, c) - Centre(result, take, s, 0) - was).norm(), 1e-4);
    }
  }
}

/// It is pressed together when it lands, springs up again, and never higher than it came from.
TEST(Bonds, ASoftBodyCompressesAndBounces) {
  const TrackedTake take = Block(4, 5, 4, 0, 76);
  const json effect = {
      {"release", kAtOnce}, {"ground", {{"height_m", -0.5}}}, {"bonds", {{"between", "released"}, {"stiffness_s2", 4000}, {"damping_ratio", 0.05}}}};
  const SimulatedTake result = Simulated(take, effect);
  const std::size_t n = take.cell_count();
  double shortest = 1;
  double lowest = 1;
  double highest_after = -1;
  for (std::size_t s = 0; s < result.time.size(); ++s) {
    double middle = 0;
    double top = -1;
    double bottom = 1;
    for (std::size_t c = 0; c < n; ++c) {
      const double y = Centre(result, take, s, c).y();
      EXPECT_GT(y, -0.5 + 0.010) << "under the ground";
      middle += y / static_cast<double>(n);
      top = std::max(top, y);
      bottom = std::min(bottom, y);
    }
    shortest = std::min(shortest, top - bottom);
    if (middle < lowest) {
      lowest = middle;
      highest_after = middle;
    }
    highest_after = std::max(highest_after, middle);
  }
  EXPECT_LT(shortest, 0.14);                // 16 cm at rest
  EXPECT_GT(shortest, 0.02);                // not flat
  EXPECT_GT(highest_after, lowest + 0.02);  // it sprang
  EXPECT_LT(highest_after, 0.1);            // where it was let go
}

TEST(Bonds, OverstretchedOnesBreakForGood) {
  const TrackedTake take = Block(1, 6, 1, 0.5, 60);
  // The upper half stays recalled, the lower hangs from it: whether it holds is up to the bond.
  const json hang = {{"release", {{{"by", "height"}, {"from", "bottom"}, {"share", 0.5}, {"end_s", 0}}}}, {"ground", {{"enabled", false}}}};
  json strong = hang;
  strong["bonds"] = {{"between", "released"}, {"stiffness_s2", 20000}, {"break_stretch", 0.5}};
  json weak = hang;
  weak["bonds"] = {{"between", "released"}, {"stiffness_s2", 300}, {"break_stretch", 0.3}};
  const SimulatedTake holds = Simulated(take, strong);
  const SimulatedTake breaks = Simulated(take, weak);
  const std::size_t last = holds.time.size() - 1;
  EXPECT_GT(Centre(holds, take, last, 0).y(), take.model.cells.centroid[0].y() - 0.03);
  EXPECT_LT(Centre(breaks, take, last, 0).y(), take.model.cells.centroid[0].y() - 0.2);
}

TEST(Bonds, NothingMovesWhenAllIsRecalledAtRest) {
  const TrackedTake take = Block(3, 6, 3, 0, 20);
  const SimulatedTake result = Simulated(take, {{"bonds", {{"between", "all"}, {"break_stretch", 0.01}}}});
  for (std::size_t s = 0; s < result.time.size(); ++s) {
    for (std::size_t c = 0; c < take.cell_count(); ++c) EXPECT_EQ((Centre(result, take, s, c) - Centre(result, take, 0, c)).norm(), 0);
  }
}

/// A blow on one side is felt on the other, and in the end all is back in place.
TEST(Bonds, ARecalledSoftBodyCarriesABlowOnAndComesBack) {
  const TrackedTake take = Block(6, 3, 3, 0, 150);
  const json ball = {
      {"kind", "sphere"},
      {"radius_m", 0.05},
      {"position_m", {{{"t", 0}, {"value", {-0.4, 0.06, 0}}}, {{"t", 0.4}, {"value", {-0.14, 0.06, 0}}}, {{"t", 0.8}, {"value", {-0.4, 0.06, 0}}}}},
      {"motion", "driven"}};
  // Of the cells on the far side, over the time of the blow and after.
  const auto farthest = [&](const SimulatedTake& result) {
    double away = 0;
    for (std::size_t i = 20 * take.cell_count(); i < 40 * take.cell_count(); ++i) {
      const std::size_t s = i / take.cell_count();
      const std::size_t c = i % take.cell_count();
      if (take.model.cells.centroid[c].x() > 0.09) away = std::max(away, (Centre(result, take, s, c) - take.model.cells.centroid[c]).norm());
    }
    return away;
  };
  const SimulatedTake soft = Simulated(take, {{"objects", {ball}}, {"bonds", {{"between", "all"}, {"stiffness_s2", 20000}}}});
  const SimulatedTake separate = Simulated(take, {{"objects", {ball}}});
  EXPECT_LT(farthest(separate), 1e-6);
  EXPECT_GT(farthest(soft), 1e-4);
  for (std::size_t c = 0; c < take.cell_count(); ++c)
    EXPECT_LT((Centre(soft, take, soft.time.size() - 1, c) - take.model.cells.centroid[c]).norm(), 1e-4);
  EXPECT_EQ(std::ranges::count(soft.cell_state, CellState::kReleased), 0);
}

}  // namespace
}  // namespace vorocast::simulation
