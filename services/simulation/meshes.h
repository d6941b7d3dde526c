// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include "services/geometry/triangle_mesh.h"

/// Low-poly shapes of scene objects, closed and oriented outwards.
namespace vorocast::simulation {

geometry::TriangleMesh BoxMesh(const geometry::Vec3& half);
/// An icosahedron refined twice: 162 vertices on the sphere.
geometry::TriangleMesh SphereMesh(double radius);
/// A prism of eight sides from (0, 0, 0) down to (0, −length, 0).
geometry::TriangleMesh ArmMesh(double radius, double length);
/// Both as one mesh.
geometry::TriangleMesh Join(const geometry::TriangleMesh& a, const geometry::TriangleMesh& b, const geometry::Vec3& b_offset);

}  // namespace vorocast::simulation
