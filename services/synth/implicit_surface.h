// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "services/geometry/triangle_mesh.h"

namespace vorocast::synth {

/// A ball swept from `from` to `to` while its radius goes linearly from one to the other, the radii stretched axis by axis (1 = not). An
/// ellipsoid is one with from == to.
struct Blob {
  geometry::Vec3 from, to;
  double from_radius = 0, to_radius = 0;  // metres
  geometry::Vec3 stretch = geometry::Vec3::Ones();
  std::int32_t bone = 0;   // what moves it
  std::int32_t part = 0;   // what it is called and coloured after
  std::int32_t limb = -1;  // blobs added one after another with the same number ≥ 0 are one limb

  /// Negative inside; the distance to first order near the surface.
  double Distance(const geometry::Vec3& x) const;
};

/// Blobs melted together: a smooth union whose creases are filled. Within a limb they are filled little, so that a chain of equal blobs does not
/// swell where two overlap.
class ImplicitSurface {
 public:
  /// Creases are filled up to `blend_m` between limbs and `seam_m` within one; everything is cut flat below `floor_m`.
  explicit ImplicitSurface(double blend_m, double seam_m, double floor_m = -1e9) : blend_(blend_m), seam_(seam_m), floor_(floor_m) {}

  void Add(const Blob& blob);
  const std::vector<Blob>& blobs() const { return blobs_; }
  double blend_m() const { return blend_; }

  double operator()(const geometry::Vec3& x) const { return Value(x, all_); }
  /// The same from those blobs alone that count at x, in ascending order.
  double Value(const geometry::Vec3& x, std::span<const std::size_t> near) const;
  /// The value at x, and which blobs count within `radius` of it.
  double Near(const geometry::Vec3& x, double radius, std::vector<std::size_t>& near) const;
  geometry::Box3 Bounds() const;

 private:
  struct Ball {
    geometry::Vec3 centre;
    double radius = 0;
  };
  double blend_, seam_, floor_;
  std::vector<Blob> blobs_;
  std::vector<std::size_t> all_;  // 0, 1, 2 …
  std::vector<Ball> around_;      // encloses the blob of the same index
};

/// The zero level as a closed mesh, outward, one vertex a crossed grid cell (surface nets), vertices spread evenly and moved onto the level. A
/// library's Delaunay refinement would take many seconds for what must be ready before every demo and every test.
geometry::TriangleMesh ExtractSurface(const ImplicitSurface& surface, double cell_m);

}  // namespace vorocast::synth
