// SPDX-License-Identifier: AGPL-3.0-or-later
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "services/capture/frame_parser.h"
#include "tests/unit/services/capture/frame_files.h"

namespace vorocast::capture {
namespace {

using geometry::Vec3;
using testing::DracoMethod;
using ::testing::HasSubstr;

class Draco : public ::testing::TestWithParam<DracoMethod> {};

TEST_P(Draco, ReadsAMesh) {
  const auto frame = ParseDraco(testing::DracoMesh(testing::Cube(2, Vec3(1, 2, 3)), GetParam()));
  ASSERT_TRUE(frame.ok()) << frame.status();
  EXPECT_EQ(frame->mesh.vertices.size(), 8U);
  EXPECT_EQ(frame->mesh.triangles.size(), 12U);
  EXPECT_TRUE(geometry::IsClosed(frame->mesh));
  // 14 bits over a side of 2.
  EXPECT_NEAR(geometry::SignedVolume(frame->mesh), 8, 0.01);
  geometry::Box3 box;
  for (const Vec3& v : frame->mesh.vertices) box.extend(v);
  EXPECT_NEAR((box.min() - Vec3(1, 2, 3)).norm(), 0, 1e-3);
}

TEST_P(Draco, ReadsACloudWithNormalsAndColours) {
  const geometry::OrientedPoints sphere = testing::Sphere(200, 0.9, Vec3(0, 1, 0));
  const auto frame = ParseDraco(testing::DracoCloud(sphere, GetParam()));
  ASSERT_TRUE(frame.ok()) << frame.status();
  ASSERT_EQ(frame->mesh.vertices.size(), 200U);
  ASSERT_EQ(frame->normals.size(), 200U);
  ASSERT_EQ(frame->mesh.colours.size(), 200U);
  EXPECT_FALSE(frame->is_mesh());
  for (std::size_t i = 0; i < 200; ++i) {
    const Vec3 direction = (frame->mesh.vertices[i] - Vec3(0, 1, 0)).normalized();
    EXPECT_GT(direction.dot(frame->normals[i].normalized()), 0.999);
    // The colour tells which point it is: Draco may change the order.
    const geometry::Rgb8 colour = frame->mesh.colours[i];
    EXPECT_NEAR((frame->mesh.vertices[i] - sphere.positions[colour[0]]).norm(), 0, 1e-3);
    EXPECT_EQ(colour[1], 100);
    EXPECT_EQ(colour[2], 200);
  }
}

INSTANTIATE_TEST_SUITE_P(Methods, Draco, ::testing::Values(DracoMethod::kSequential, DracoMethod::kCompact));

TEST(DracoRefusals, SayWhatToDo) {
  const auto message = [](const std::string& bytes) { return std::string(ParseDraco(bytes).status().message()); };
  EXPECT_THAT(message(""), HasSubstr("truncated or damaged"));
  EXPECT_THAT(message("not Draco at all"), HasSubstr("copy it again"));
  std::string cloud = testing::DracoCloud(testing::Sphere(40, 1, Vec3::Zero()), DracoMethod::kSequential);
  // The header's 11 bytes are followed by the number of points.
  cloud.replace(11, 4, std::string("\xff\xff\xff\x7f", 4));
  EXPECT_THAT(message(cloud), HasSubstr("declares 2147483647 points"));
  std::string mesh = testing::DracoMesh(testing::Cube(1, Vec3::Zero()), DracoMethod::kSequential);
  mesh.replace(11, 1, std::string("\xff\xff\xff\xff\x07", 5));
  EXPECT_THAT(message(mesh), HasSubstr("vertices or faces"));
}

}  // namespace
}  // namespace vorocast::capture
