// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include "services/geometry/tracked_take.h"
#include "services/geometry/triangle_mesh.h"
#include "workers/tracking/tracking.h"

namespace vorocast::tracking {

/// A closed limb of 0.6 m along x around the origin, about 6 cm thick, with a cross-section that neither turns nor slides into itself.
geometry::TriangleMesh LimbMesh();

/// Where the limb's point x goes when its half beyond x = 0 is turned by `angle` about z, the bend being spread over ±15 cm.
geometry::Vec3 Bend(const geometry::Vec3& x, double angle);

geometry::TriangleMesh Bent(geometry::TriangleMesh mesh, double angle);
geometry::TriangleMesh Moved(geometry::TriangleMesh mesh, const geometry::Rigid3& pose);

/// The limb cut into lattice cells of 2.5 cm and 60 patches.
geometry::Template LimbTemplate(std::int32_t frame);

/// Fresh random points of a mesh with Gaussian noise, and the centroids of a lattice of its own as inner points.
Observation Observe(std::int32_t frame, const geometry::TriangleMesh& mesh, std::size_t points, double noise_m);

/// A track in which every patch has the same pose in every frame.
geometry::PoseTrack ConstantTrack(const geometry::Template& model, std::vector<std::int32_t> frames, const geometry::Rigid3& pose);

}  // namespace vorocast::tracking
