// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cstring>
#include <string>
#include <vector>

#include "services/geometry/oriented_points.h"
#include "services/geometry/triangle_mesh.h"

/// Frame files made byte by byte, for the unit tests and the fuzzer alike: no binary files in the tree.
namespace vorocast::capture::testing {

/// Appends a value in either byte order.
template <typename T>
void Put(std::string& bytes, T value, bool big_endian) {
  std::array<char, sizeof(T)> raw;
  std::memcpy(raw.data(), &value, sizeof(T));
  if (big_endian != (std::endian::native == std::endian::big)) std::ranges::reverse(raw);
  bytes.append(raw.begin(), raw.end());
}

/// A closed cube of 12 outward triangles with the given side, its lowest corner at `corner`.
geometry::TriangleMesh Cube(double side, const geometry::Vec3& corner);
/// `count` points on a sphere with outward normals (a Fibonacci spiral) and colours.
geometry::OrientedPoints Sphere(std::size_t count, double radius, const geometry::Vec3& centre);

/// x y z nx ny nz as doubles and red green blue as bytes.
std::string BinaryPly(const geometry::OrientedPoints& points, bool big_endian);
std::string AsciiPly(const geometry::TriangleMesh& mesh);
std::string Obj(const geometry::TriangleMesh& mesh);
std::string Off(const geometry::TriangleMesh& mesh);

enum class DracoMethod { kSequential, kCompact };
std::string DracoMesh(const geometry::TriangleMesh& mesh, DracoMethod method);
std::string DracoCloud(const geometry::OrientedPoints& points, DracoMethod method);

struct CorpusFile {
  std::string name;
  std::string extension;
  std::string bytes;
};

/// Small valid files of every format and encoding.
std::vector<CorpusFile> Corpus();

}  // namespace vorocast::capture::testing
