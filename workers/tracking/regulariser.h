// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <vector>

#include "workers/tracking/normal_equations.h"
#include "workers/tracking/patch_model.h"

namespace vorocast::tracking {

/// The affine map that edge (k, l)'s patches should be related by: x_in_l = matrix · x_in_k + offset, both in template coordinates.
/// A pose's own relation T_l⁻¹ ∘ T_k is rigid; the mean over several poses is affine.
struct Relation {
  geometry::Mat3 matrix = geometry::Mat3::Identity();
  geometry::Vec3 offset = geometry::Vec3::Zero();
};

/// T_l⁻¹ ∘ T_k of each edge of a pose.
std::vector<Relation> RelationsOf(const PatchModel& model, const Pose& pose);

/// D(pose, reference) = Σ_(k,l) Σ_{x ∈ k ∪ l} mass |T_k x − T_l (M_kl x)|² (paper, section 4.4, turned into the world, which changes no length). m².
double PoseDistance(const PatchModel& model, const Pose& pose, const std::vector<Relation>& reference);

/// Adds weight · D and its derivatives to the equations.
void AddPoseDistance(const PatchModel& model, const Pose& pose, const std::vector<Relation>& reference, double weight, NormalEquations& equations);

}  // namespace vorocast::tracking
