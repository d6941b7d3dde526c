// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <cstdint>
#include <vector>

#include "services/geometry/triangle_mesh.h"

namespace vorocast::synth {

/// A ball swept from `from` to `to` while its radius goes linearly from one to the other, the radii stretched axis by axis (1 = not). An
/// ellipsoid is one with from == to.
struct Blob {
  geometry::Vec3 from, to;
  double from_radius = 0, to_radius = 0;  // metres
  geometry::Vec3 stretch = geometry::Vec3::Ones();
  std::int32_t bone = 0;  // what moves it
  std::int32_t part = 0;  // what it is called and coloured after

  /// Negative inside, a lower bound of the distance outside.
  double Distance(const geometry::Vec3& x) const;
};

/// Blobs melted together: a smooth union whose creases are filled up to `blend` metres.
struct ImplicitSurface {
  std::vector<Blob> blobs;
  double blend = 0.03;
  double floor = -1e9;  // cut flat below this height

  double operator()(const geometry::Vec3& x) const;
  geometry::Vec3 Gradient(const geometry::Vec3& x) const;
  geometry::Box3 Bounds() const;
};

/// The zero level as a closed mesh, outward, one vertex a crossed grid cell (surface nets), vertices spread evenly and moved onto the level. A
/// library's Delaunay refinement would take seconds for what must be ready before every demo and every test; this takes a tenth of one.
geometry::TriangleMesh ExtractSurface(const ImplicitSurface& surface, double cell_m);

}  // namespace vorocast::synth
