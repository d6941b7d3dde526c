// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <cstdint>
#include <vector>

#include "workers/tracking/patch_model.h"
#include "workers/tracking/regulariser.h"
#include "workers/tracking/tracking.h"

namespace vorocast::bench {

/// An observed point and the point of the template it belongs to: weight (normal · (T_patch template_point − observed))².
struct PlaneTerm {
  std::int32_t patch = 0;
  geometry::Vec3 template_point, observed, normal;
};

/// One frame's poses as a least-squares problem with fixed partners, the same for whoever solves it: the terms above, and
/// regulariser · D(pose, reference) (workers/tracking/regulariser.h).
struct FrameProblem {
  tracking::PatchModel model;
  std::vector<PlaneTerm> terms;
  std::vector<tracking::Relation> reference;
  double regulariser = 0;
  tracking::Pose start;

  double DataEnergy(const tracking::Pose& pose) const;  // m²
  double Energy(const tracking::Pose& pose) const;      // with the regulariser, m²
};

/// Each observed point's partner is the nearest compatible sample of the template's surface in `start`; the template's own pose is the reference.
FrameProblem MakeFrameProblem(const geometry::Template& model, const tracking::Observation& frame, tracking::Pose start);

struct FrameSolution {
  tracking::Pose pose;
  std::int32_t iterations = 0;
};

/// A solver stops when an iteration takes less than this share of the energy away.
inline constexpr double kEnergyTolerance = 1e-6;

/// With tracking's own normal equations and block Cholesky: Gauss–Newton.
FrameSolution SolveWithBlocks(const FrameProblem& problem);

}  // namespace vorocast::bench
