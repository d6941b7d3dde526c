// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "services/geometry/vector.h"

namespace vorocast::cvt {

/// Where lines along x meet a closed triangle mesh. A line that passes through a vertex or along an edge is decided as if it were moved by an
/// infinitesimal amount, the same for every triangle, so that crossings always come in pairs of entering and leaving.
class XRays {
 public:
  /// Keeps references: both must outlive this index.
  XRays(const std::vector<geometry::Vec3>& vertices, const std::vector<std::array<std::int32_t, 3>>& triangles);

  /// The sorted x of all crossings of the line (y, z); an even number for a closed mesh.
  void Crossings(double y, double z, std::vector<double>* crossings) const;
  /// True when an odd number of crossings lies beyond the point.
  bool Inside(const geometry::Vec3& point) const;
  /// How many times the surface winds around the point: 1 inside and 0 outside, other numbers where it overlaps itself.
  std::int32_t Winding(const geometry::Vec3& point) const;

 private:
  /// Calls visit(x, leaves) for every crossing of the line (y, z); `leaves` when the line, followed towards +x, leaves the solid there.
  template <typename Visit>
  void VisitCrossings(double y, double z, Visit&& visit) const;
  std::int32_t Column(double y) const;
  std::int32_t Row(double z) const;

  const std::vector<geometry::Vec3>& vertices_;
  const std::vector<std::array<std::int32_t, 3>>& triangles_;
  double y_low_ = 0, z_low_ = 0, y_scale_ = 0, z_scale_ = 0;
  std::int32_t columns_ = 1, rows_ = 1;
  std::vector<std::int64_t> bucket_begin_;  // [columns*rows + 1]
  std::vector<std::int32_t> bucket_;        // triangles whose (y, z) box touches the bucket
};

}  // namespace vorocast::cvt
