// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include "services/geometry/cells.h"

namespace vorocast::bench {

struct BulletSteps {
  double cpu_s_a_step = 0;
  double drift_max_m = 0;  // of a cell that should stay where it is
};

/// Cells held where they are, with Bullet as one would first write it: a convex hull a cell, in metres, with the default margin, recalled by a force
/// at the centre; every contact counts. `steps` steps of 1 / 240 s.
BulletSteps StepWithBullet(const geometry::Cells& cells, int steps);

}  // namespace vorocast::bench
