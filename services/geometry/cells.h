// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "services/geometry/oriented_points.h"
#include "services/geometry/vector.h"

namespace vorocast::geometry {

/// A shape cut into Voronoi cells, each clipped exactly at the surface: the content of cells.h5 (docs/storage_format.md).
/// n cells, f faces, v vertices. Polyhedra are stored as compressed rows: cell c has faces face_offset[c] … face_offset[c+1]−1,
/// face i has the vertex loop vertex[vertex_offset[i] … vertex_offset[i+1]−1], counter-clockwise seen from outside the cell.
/// Each cell's polyhedron is closed: every directed edge of its faces has its opposite in the same cell. Vertices are shared between cells.
struct Cells {
  std::vector<Vec3> sites;              // [n] metres
  std::vector<double> volume;           // [n] m³, exact for the clipped polyhedron
  std::vector<Vec3> centroid;           // [n]
  std::vector<std::uint8_t> boundary;   // [n] 1 where the cell touches the surface
  std::vector<double> depth;            // [n] distance from the centroid to the surface, metres
  std::vector<std::int32_t> component;  // [n] connected component of the shape; cells of different components are never neighbours

  std::vector<std::int64_t> face_offset;    // [n+1]
  std::vector<std::int64_t> vertex_offset;  // [f+1]
  std::vector<std::int32_t> vertex;         // [vertex_offset[f]] index into vertices
  std::vector<std::int32_t> neighbour;      // [f] cell on the other side, or −1 on the surface
  std::vector<Vec3> vertices;               // [v]

  OrientedPoints surface;  // what was observed: the frame's own points with unit normals, metres

  double energy = 0;        // CVT energy E (paper, section 3.1), m⁵
  double surface_area = 0;  // of the shape, m²
  std::int32_t iterations = 0;

  std::size_t size() const { return sites.size(); }
};

/// Pairs (a < b) of cells that share a face, sorted, each once.
std::vector<std::array<std::int32_t, 2>> NeighbourPairs(const Cells& cells);

/// Normalised second moment E / (3 n (V/n)^(5/3)) of the stored cells: 0.0785 for a BCC lattice (the limit), 0.0833 for cubes.
double NormalisedSecondMoment(const Cells& cells);

}  // namespace vorocast::geometry
