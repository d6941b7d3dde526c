// SPDX-License-Identifier: AGPL-3.0-or-later
#include "tests/unit/services/capture/frame_files.h"

#include <draco/compression/encode.h>
#include <draco/compression/expert_encode.h>
#include <draco/mesh/triangle_soup_mesh_builder.h>
#include <draco/point_cloud/point_cloud_builder.h>
#include <fmt/format.h>

#include <numbers>

#include "services/base/check.h"

namespace vorocast::capture::testing {

using geometry::OrientedPoints;
using geometry::TriangleMesh;
using geometry::Vec3;

TriangleMesh Cube(double side, const Vec3& corner) {
  TriangleMesh mesh;
  for (int i = 0; i < 8; ++i) mesh.vertices.push_back(corner + side * Vec3(i & 1, (i >> 1) & 1, (i >> 2) & 1));
  mesh.triangles = {{0, 2, 3}, {0, 3, 1}, {4, 5, 7}, {4, 7, 6}, {0, 1, 5}, {0, 5, 4},
                    {2, 6, 7}, {2, 7, 3}, {0, 4, 6}, {0, 6, 2}, {1, 3, 7}, {1, 7, 5}};
  return mesh;
}

OrientedPoints Sphere(std::size_t count, double radius, const Vec3& centre) {
  OrientedPoints points;
  const double golden_angle = std::numbers::pi * (3 - std::sqrt(5.0));
  for (std::size_t i = 0; i < count; ++i) {
    const double y = 1 - 2 * (static_cast<double>(i) + 0.5) / static_cast<double>(count);
    const double r = std::sqrt(1 - y * y);
    const double angle = golden_angle * static_cast<double>(i);
    const Vec3 normal(r * std::cos(angle), y, r * std::sin(angle));
    points.positions.push_back(centre + radius * normal);
    points.normals.push_back(normal);
    points.colours.push_back({static_cast<std::uint8_t>(i % 256), 100, 200});
  }
  return points;
}

std::string BinaryPly(const OrientedPoints& points, bool big_endian) {
  std::string bytes = fmt::format(
      "ply\nformat binary_{}_endian 1.0\ncomment made by a test\nelement vertex {}\nproperty double x\nproperty double y\nproperty double z\n"
      "property double nx\nproperty double ny\nproperty double nz\nproperty uchar red\nproperty uchar green\nproperty uchar blue\nend_header\n",
      big_endian ? "big" : "little", points.size());
  for (std::size_t i = 0; i < points.size(); ++i) {
    for (int axis = 0; axis < 3; ++axis) Put(bytes, points.positions[i][axis], big_endian);
    for (int axis = 0; axis < 3; ++axis) Put(bytes, points.normals[i][axis], big_endian);
    for (std::uint8_t channel : points.colours[i]) Put(bytes, channel, big_endian);
  }
  return bytes;
}

std::string AsciiPly(const TriangleMesh& mesh) {
  std::string bytes = fmt::format(
      "ply\nformat ascii 1.0\nelement vertex {}\nproperty float x\nproperty float y\nproperty float z\nelement face {}\n"
      "property list uchar int vertex_indices\nend_header\n",
      mesh.vertices.size(), mesh.triangles.size());
  for (const Vec3& v : mesh.vertices) bytes += fmt::format("{} {} {}\n", v.x(), v.y(), v.z());
  for (const auto& t : mesh.triangles) bytes += fmt::format("3 {} {} {}\n", t[0], t[1], t[2]);
  return bytes;
}

std::string Obj(const TriangleMesh& mesh) {
  std::string bytes = "# made by a test\no cube\n";
  for (const Vec3& v : mesh.vertices) bytes += fmt::format("v {} {} {}\n", v.x(), v.y(), v.z());
  for (const auto& t : mesh.triangles) bytes += fmt::format("f {} {} {}\n", t[0] + 1, t[1] + 1, t[2] + 1);
  return bytes;
}

std::string Off(const TriangleMesh& mesh) {
  std::string bytes = fmt::format("OFF\n{} {} 0\n", mesh.vertices.size(), mesh.triangles.size());
  for (const Vec3& v : mesh.vertices) bytes += fmt::format("{} {} {}\n", v.x(), v.y(), v.z());
  for (const auto& t : mesh.triangles) bytes += fmt::format("3 {} {} {}\n", t[0], t[1], t[2]);
  return bytes;
}

namespace {

std::array<float, 3> Floats(const Vec3& v) { return {static_cast<float>(v.x()), static_cast<float>(v.y()), static_cast<float>(v.z())}; }

std::string TakeBytes(const draco::Status& status, const draco::EncoderBuffer& buffer) {
  VOROCAST_CHECK(status.ok());
  return std::string(buffer.data(), buffer.size());
}

}  // namespace

std::string DracoMesh(const TriangleMesh& mesh, DracoMethod method) {
  draco::TriangleSoupMeshBuilder builder;
  builder.Start(static_cast<int>(mesh.triangles.size()));
  const int position = builder.AddAttribute(draco::GeometryAttribute::POSITION, 3, draco::DT_FLOAT32);
  for (std::size_t f = 0; f < mesh.triangles.size(); ++f) {
    std::array<std::array<float, 3>, 3> corners;
    for (std::size_t i = 0; i < 3; ++i) corners[i] = Floats(mesh.vertices[static_cast<std::size_t>(mesh.triangles[f][i])]);
    builder.SetAttributeValuesForFace(position, draco::FaceIndex(static_cast<std::uint32_t>(f)), corners[0].data(), corners[1].data(),
                                      corners[2].data());
  }
  const std::unique_ptr<draco::Mesh> soup = builder.Finalize();
  VOROCAST_CHECK(soup != nullptr);
  draco::Encoder encoder;
  encoder.SetAttributeQuantization(draco::GeometryAttribute::POSITION, 14);
  encoder.SetEncodingMethod(method == DracoMethod::kCompact ? draco::MESH_EDGEBREAKER_ENCODING : draco::MESH_SEQUENTIAL_ENCODING);
  draco::EncoderBuffer buffer;
  return TakeBytes(encoder.EncodeMeshToBuffer(*soup, &buffer), buffer);
}

std::string DracoCloud(const OrientedPoints& points, DracoMethod method) {
  draco::PointCloudBuilder builder;
  builder.Start(static_cast<std::uint32_t>(points.size()));
  const int position = builder.AddAttribute(draco::GeometryAttribute::POSITION, 3, draco::DT_FLOAT32);
  const int normal = builder.AddAttribute(draco::GeometryAttribute::NORMAL, 3, draco::DT_FLOAT32);
  const int colour = builder.AddAttribute(draco::GeometryAttribute::COLOR, 3, draco::DT_UINT8);
  for (std::size_t i = 0; i < points.size(); ++i) {
    const draco::PointIndex at(static_cast<std::uint32_t>(i));
    builder.SetAttributeValueForPoint(position, at, Floats(points.positions[i]).data());
    builder.SetAttributeValueForPoint(normal, at, Floats(points.normals[i]).data());
    builder.SetAttributeValueForPoint(colour, at, points.colours[i].data());
  }
  const std::unique_ptr<draco::PointCloud> cloud = builder.Finalize(false);
  VOROCAST_CHECK(cloud != nullptr);
  draco::Encoder encoder;
  encoder.SetAttributeQuantization(draco::GeometryAttribute::POSITION, 14);
  encoder.SetAttributeQuantization(draco::GeometryAttribute::NORMAL, 10);
  encoder.SetEncodingMethod(method == DracoMethod::kCompact ? draco::POINT_CLOUD_KD_TREE_ENCODING : draco::POINT_CLOUD_SEQUENTIAL_ENCODING);
  draco::EncoderBuffer buffer;
  return TakeBytes(encoder.EncodePointCloudToBuffer(*cloud, &buffer), buffer);
}

std::vector<CorpusFile> Corpus() {
  const TriangleMesh cube = Cube(1.5, Vec3(0.25, 0, -1));
  const OrientedPoints sphere = Sphere(40, 0.9, Vec3(0, 1, 0));
  return {{"ply_little", ".ply", BinaryPly(sphere, false)},
          {"ply_big", ".ply", BinaryPly(sphere, true)},
          {"ply_ascii", ".ply", AsciiPly(cube)},
          {"obj", ".obj", Obj(cube)},
          {"off", ".off", Off(cube)},
          {"draco_edgebreaker", ".drc", DracoMesh(cube, DracoMethod::kCompact)},
          {"draco_sequential", ".drc", DracoMesh(cube, DracoMethod::kSequential)},
          {"draco_cloud_sequential", ".drc", DracoCloud(sphere, DracoMethod::kSequential)},
          {"draco_cloud_kd_tree", ".drc", DracoCloud(sphere, DracoMethod::kCompact)}};
}

}  // namespace vorocast::capture::testing
