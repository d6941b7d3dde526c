// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <vector>

#include "workers/tracking/tracking.h"

namespace vorocast::tracking {

/// A frame's observation made ready for association: finite points only, unit normals, ordered along a space-filling curve, so that neighbours in
/// memory are neighbours in space and every n-th point is an even sample.
struct ObservedFrame {
  std::vector<geometry::Vec3> position;
  std::vector<geometry::Vec3> normal;
  std::vector<geometry::Vec3> inner;
  std::vector<double> inner_depth;

  bool empty() const { return position.empty(); }
};

/// INVALID_ARGUMENT when the arrays of the observation do not fit each other. A missing frame gives an empty one.
absl::StatusOr<ObservedFrame> PrepareObservation(const Observation& observation);

}  // namespace vorocast::tracking
