// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <array>
#include <vector>

#include "services/geometry/triangle_mesh.h"
#include "services/synth/skeleton.h"

namespace vorocast::synth {

/// Which bones carry a vertex; weights add up to one, unused ones are zero.
struct SkinWeights {
  std::array<std::int32_t, 4> bone{};
  std::array<double, 4> weight{};
};

/// A closed body at rest with what moves it.
struct SkinnedBody {
  geometry::TriangleMesh rest;  // metres; with colours
  std::vector<SkinWeights> weights;
  std::vector<std::int32_t> part;  // a synth::Part a vertex
};

/// The dancer without her skirt, meshed on a grid of `cell_m`.
SkinnedBody MakeDancer(double cell_m);

/// The body's vertices in a pose, by dual quaternion skinning (Kavan et al. 2008): elbows keep their volume and shoulders do not collapse.
std::vector<geometry::Vec3> PoseSkin(const SkinnedBody& body, const Pose& pose);

}  // namespace vorocast::synth
