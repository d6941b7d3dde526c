// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <vector>

#include "services/geometry/cells.h"
#include "services/geometry/rigid3.h"
#include "services/simulation/effect_settings.h"

namespace vorocast::simulation {

/// Bullet adds this skin around every hull, so a hull is made smaller by as much.
inline constexpr double kHullMargin = 0.0001;

/// Hulls are thinned out to so many corners: more cost time in every contact and change little that is seen.
inline constexpr std::size_t kHullCorners = 16;

/// A cell as a rigid body. The body frame has its origin at the cell's centroid and the hull's principal axes of inertia.
struct CellShape {
  std::vector<geometry::Vec3> hull;         // corners in the body frame, metres; at least 4, at most kHullCorners; has volume
  std::vector<geometry::Vec3> all_corners;  // before thinning out: what is seen, and what stands on the ground
  geometry::Quat cell_from_body;            // the cell frame has the same origin and the template's axes (tracked_motion.h)
  double mass = 0;                          // kg
  geometry::Vec3 inertia;                   // kg m², about the body's axes
  double radius = 0;                        // of the sphere around the centroid that holds hull and margin
};

/// One shape a cell. The hull of the cell's polyhedron with each face moved inwards by margin + shrink, thinned out to at most kHullCorners corners.
/// Flat, tiny and empty cells get a small box of at least a millimetre instead; masses have a floor of a hundredth of the mean.
std::vector<CellShape> MakeCellShapes(const geometry::Cells& cells, const CellSettings& settings);

/// At most kHullCorners of the corners, spread out: each next one is the farthest from those chosen.
std::vector<geometry::Vec3> ThinOutCorners(const std::vector<geometry::Vec3>& corners);

}  // namespace vorocast::simulation
