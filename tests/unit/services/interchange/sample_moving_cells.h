// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include "services/interchange/moving_cells.h"
#include "tests/unit/services/storage/sample_takes.h"

namespace vorocast::interchange {

/// Three unit cubes in a row at three instants: the first stays and never moves, the second is released after the first instant and turns, the third
/// is gone at the last. A tetrahedron rises beside them.
inline MovingCells ThreeCubesMoving() {
  MovingCells take;
  take.model = storage::ThreeCubes();
  take.frames_per_second = 50;
  take.time = {0, 0.02, 0.06};
  for (int instant = 0; instant < 3; ++instant) {
    for (int cell = 0; cell < 3; ++cell) {
      const double angle = cell == 0 ? 0 : 1.2 * instant * cell;  // beyond half a turn, where the quaternion's sign matters
      const geometry::Quat turn(Eigen::AngleAxisd(angle, geometry::Vec3(1, 2, 2) / 3));
      take.rotation.emplace_back(static_cast<float>(turn.w()), static_cast<float>(turn.x()), static_cast<float>(turn.y()),
                                 static_cast<float>(turn.z()));
      take.translation.emplace_back(cell == 0 ? 0 : 0.25 * instant, 0.5 * cell, 0);
    }
  }
  using enum geometry::CellState;
  take.state = {kRecalled, kRecalled, kRecalled, kRecalled, kReleased, kRecalled, kRecalled, kReleased, kGone};
  take.objects = {storage::TwoCubesAndABall().objects[0]};
  for (int instant = 0; instant < 3; ++instant) take.object_pose.push_back({geometry::Quat::Identity(), geometry::Vec3(4, instant, 0)});
  return take;
}

}  // namespace vorocast::interchange
