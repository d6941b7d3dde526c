// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "services/geometry/oriented_points.h"
#include "services/geometry/vector.h"

namespace vorocast::geometry {

/// Triangles counter-clockwise seen from outside.
struct TriangleMesh {
  std::vector<Vec3> vertices;
  std::vector<std::array<std::int32_t, 3>> triangles;
  std::vector<Rgb8> colours;  // as many as vertices, or empty
};

/// Signed volume enclosed by a closed mesh (divergence theorem), m³; positive when oriented outward.
double SignedVolume(const TriangleMesh& mesh);
/// Sum of the triangles' areas, m².
double SurfaceArea(const TriangleMesh& mesh);
/// Area-weighted unit vertex normals; zero where a vertex has no area around it.
std::vector<Vec3> VertexNormals(const TriangleMesh& mesh);
/// True when every directed edge has exactly one opposite: closed, consistently oriented, edge-manifold.
bool IsClosed(const TriangleMesh& mesh);
/// `count` points uniform by area with their triangle's normal; deterministic in the seed. Empty for a mesh without area.
OrientedPoints SampleSurface(const TriangleMesh& mesh, std::size_t count, std::uint64_t seed);

}  // namespace vorocast::geometry
