// SPDX-License-Identifier: AGPL-3.0-or-later
// Cells thrown at what must hold them: none ends up on the other side.
#include <gtest/gtest.h>

#include <cmath>

#include "services/simulation/simulate.h"
#include "tests/unit/services/simulation/synthetic_take.h"

namespace vorocast::simulation {
namespace {

using geometry::CellState;
using geometry::Quat;
using geometry::Rigid3;
using geometry::SimulatedTake;
using geometry::TrackedTake;
using geometry::Vec3;
using nlohmann::json;

Vec3 Centroid(const SimulatedTake& result, const TrackedTake& take, std::size_t s, std::size_t c) {
  const Eigen::Vector4f& q = result.cell_rotation[s * take.cell_count() + c];
  return Rigid3{Quat(q[0], q[1], q[2], q[3]).normalized(), result.cell_translation[s * take.cell_count() + c]} * take.model.cells.centroid[c];
}

/// A block of cells that flies along `velocity` from the start, its middle first at `from`, and is let go at once.
struct Throw {
  TrackedTake take;
  json effect;
};
Throw ThrowBlock(const Vec3& from, const Vec3& velocity) {
  geometry::Cells cells = testing::CubeBlock(3, 3, 3, 0.02, from.y() - 0.03);
  const Vec3 offset(from.x(), 0, from.z());
  Throw thrown;
  thrown.take = testing::Animate(std::move(cells), 21, 25, [&](const Vec3&, double time) {
    return Rigid3{Quat::Identity(), Vec3(offset + time * velocity)};
  });
  thrown.effect = {{"name", "throw"}, {"gravity_m_s2", 0}, {"release", {{{"by", "height"}, {"start_s", 0}, {"end_s", 0}}}}};
  return thrown;
}

json MeshWall(double x) {
  return {{"kind", "mesh"},
          {"vertices", {{x, -3, -3}, {x, 3, -3}, {x, 3, 3}, {x, -3, 3}}},
          {"triangles", {{0, 1, 2}, {0, 2, 3}}},
          {"origin", "world"},
          {"position_m", {0, 0, 0}},
          {"motion", "fixed"}};
}

class Thrown : public ::testing::TestWithParam<double> {};

TEST_P(Thrown, NoneIsBehindAMeshWall) {
  for (const double side : {-1.0, 1.0}) {  // its triangles' front and back
    Throw thrown = ThrowBlock(Vec3(side * 0.5, 1, 0), Vec3(-side * GetParam(), 0.1 * GetParam(), 0));
    thrown.effect["ground"] = {{"enabled", false}};
    thrown.effect["objects"] = {MeshWall(0)};
    const auto result = Simulate(thrown.take, thrown.effect, {});
    ASSERT_TRUE(result.ok()) << result.status();
    for (std::size_t s = 0; s < result->time.size(); ++s) {
      for (std::size_t c = 0; c < thrown.take.cell_count(); ++c) EXPECT_GT(side * Centroid(*result, thrown.take, s, c).x(), 0) << s << " " << c;
    }
  }
}

TEST_P(Thrown, NoneIsBelowTheGround) {
  Throw thrown = ThrowBlock(Vec3(0, 0.5, 0), Vec3(0, -GetParam(), 0));
  thrown.effect["ground"] = {{"height_m", 0}};
  const auto result = Simulate(thrown.take, thrown.effect, {});
  ASSERT_TRUE(result.ok()) << result.status();
  for (std::size_t s = 0; s < result->time.size(); ++s) {
    for (std::size_t c = 0; c < thrown.take.cell_count(); ++c) EXPECT_GT(Centroid(*result, thrown.take, s, c).y(), 0) << s << " " << c;
  }
}

/// The ball goes at 5 m/s; none is ever in it, so none came through it either.
TEST_P(Thrown, NoneIsInThePendulumsBall) {
  Throw thrown = ThrowBlock(Vec3(0.8, 1, 0), Vec3(-GetParam(), 0, 0));
  thrown.effect["ground"] = {{"enabled", false}};
  thrown.effect["gravity_m_s2"] = 9.81;
  thrown.effect["objects"] = {{{"kind", "pendulum"},
                               {"radius_m", 0.15},
                               {"arm_m", 2.5},
                               {"pivot_m", {0, 3.5, 0}},
                               {"origin", "world"},
                               {"heading_deg", 0},
                               {"hit_time_s", 0.8 / GetParam()}}};
  const auto result = Simulate(thrown.take, thrown.effect, {});
  ASSERT_TRUE(result.ok()) << result.status();
  double nearest = 10;
  for (std::size_t s = 0; s < result->time.size(); ++s) {
    const Vec3 ball = result->object_pose[s] * Vec3(0, -2.5, 0);
    for (std::size_t c = 0; c < thrown.take.cell_count(); ++c) nearest = std::min(nearest, (Centroid(*result, thrown.take, s, c) - ball).norm());
  }
  EXPECT_GT(nearest, 0.15);
  EXPECT_LT(nearest, 0.4);  // they did meet
}

INSTANTIATE_TEST_SUITE_P(Speeds, Thrown, ::testing::Values(5, 12, 20));

}  // namespace
}  // namespace vorocast::simulation
