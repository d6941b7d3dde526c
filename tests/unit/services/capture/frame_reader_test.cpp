// SPDX-License-Identifier: AGPL-3.0-or-later
#include "services/capture/frame_reader.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>

#include "services/base/random.h"
#include "services/capture/estimate_normals.h"
#include "services/capture/units.h"
#include "tests/unit/services/capture/frame_files.h"
#include "tests/unit/services/capture/temporary_folder.h"

namespace vorocast::capture {
namespace {

using geometry::OrientedPoints;
using geometry::TriangleMesh;
using geometry::Vec3;
using ::testing::AllOf;
using ::testing::HasSubstr;

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

RawFrame Cloud(const OrientedPoints& points) {
  return {.mesh = {.vertices = points.positions, .triangles = {}, .colours = points.colours}, .normals = points.normals};
}
RawFrame Mesh(const TriangleMesh& mesh) { return {.mesh = mesh, .normals = {}}; }

std::string ErrorOf(RawFrame raw, const FrameReadOptions& options = {}) {
  const auto frame = ConvertFrame(std::move(raw), options);
  return frame.ok() ? "" : std::string(frame.status().message());
}

// Each up axis becomes +y by a rotation: lengths, angles and handedness stay.
TEST(UpRotation, TurnsEveryAxisUpWithoutMirroring) {
  const std::vector<std::pair<std::string, Vec3>> axes = {{"+x", {1, 0, 0}},  {"-x", {-1, 0, 0}}, {"+y", {0, 1, 0}},
                                                          {"-y", {0, -1, 0}}, {"+z", {0, 0, 1}},  {"-z", {0, 0, -1}}};
  for (const auto& [name, axis] : axes) {
    const auto rotation = UpRotation::Parse(name);
    ASSERT_TRUE(rotation.ok());
    EXPECT_EQ(*rotation * axis, Vec3(0, 1, 0)) << name;
    EXPECT_EQ(rotation->Matrix().determinant(), 1) << name;
    EXPECT_EQ(rotation->Matrix() * rotation->Matrix().transpose(), geometry::Mat3::Identity()) << name;
  }
  // 180 degrees about x.
  EXPECT_EQ(*UpRotation::Parse("-y") * Vec3(1, 2, 3), Vec3(1, -2, -3));
}

TEST(ConvertFrame, GoesToMetresYUpAndStaysRightHanded) {
  const auto frame = ConvertFrame(Mesh(testing::Cube(150, Vec3(10, -150, 20))), {.metres_per_unit = 0.01, .up = "-y"});
  ASSERT_TRUE(frame.ok()) << frame.status();
  geometry::Box3 box;
  for (const Vec3& p : frame->points.positions) box.extend(p);
  EXPECT_NEAR((box.min() - Vec3(0.1, 0, -1.7)).norm(), 0, 1e-12);
  EXPECT_NEAR((box.max() - Vec3(1.6, 1.5, -0.2)).norm(), 0, 1e-12);
  EXPECT_NEAR(geometry::SignedVolume(frame->mesh), 3.375, 1e-12);
  EXPECT_TRUE(frame->notes.normals_from_mesh);
  for (std::size_t i = 0; i < frame->points.size(); ++i) {
    EXPECT_NEAR(frame->points.normals[i].norm(), 1, 1e-12);
    EXPECT_GT(frame->points.normals[i].dot(frame->points.positions[i] - box.center()), 0);
  }
}

TEST(ConvertFrame, NormalisesNormalsAndKeepsColours) {
  OrientedPoints sphere = testing::Sphere(500, 0.8, Vec3(0, 0.8, 0));
  for (Vec3& n : sphere.normals) n *= 17;
  const auto frame = ConvertFrame(Cloud(sphere), {});
  ASSERT_TRUE(frame.ok()) << frame.status();
  EXPECT_EQ(frame->points.colours, sphere.colours);
  for (std::size_t i = 0; i < frame->points.size(); ++i) EXPECT_NEAR((17 * frame->points.normals[i] - sphere.normals[i]).norm(), 0, 1e-12);
  EXPECT_FALSE(frame->notes.normals_estimated);
  EXPECT_TRUE(frame->mesh.triangles.empty());
}

TEST(ConvertFrame, EstimatesOutwardNormalsOfSeparateParts) {
  OrientedPoints points = testing::Sphere(3000, 0.5, Vec3(0, 0.5, 0));
  const OrientedPoints other = testing::Sphere(2000, 0.3, Vec3(2, 0.5, 0));
  points.positions.insert(points.positions.end(), other.positions.begin(), other.positions.end());
  points.normals.insert(points.normals.end(), other.normals.begin(), other.normals.end());
  RawFrame raw{.mesh = {.vertices = points.positions, .triangles = {}, .colours = {}}, .normals = {}};
  const auto frame = ConvertFrame(raw, {});
  ASSERT_TRUE(frame.ok()) << frame.status();
  EXPECT_TRUE(frame->notes.normals_estimated);
  ASSERT_EQ(frame->points.size(), points.size());
  for (std::size_t i = 0; i < points.size(); ++i) EXPECT_GT(frame->points.normals[i].dot(points.normals[i]), 0.99) << i;

  const auto quick = ConvertFrame(raw, {.estimate_normals = false});
  ASSERT_TRUE(quick.ok());
  EXPECT_TRUE(quick->points.normals.empty());
  EXPECT_THAT(ErrorOf({.mesh = {.vertices = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}, .triangles = {}, .colours = {}}, .normals = {}}),
              HasSubstr("too few"));
}

TEST(ConvertFrame, DropsAndCountsAFewBadPoints) {
  OrientedPoints sphere = testing::Sphere(1000, 0.8, Vec3(0, 0.8, 0));
  sphere.positions[10].x() = kNan;
  sphere.positions[500].z() = std::numeric_limits<double>::infinity();
  sphere.normals[700] = Vec3::Zero();
  sphere.normals[900].y() = kNan;
  const auto frame = ConvertFrame(Cloud(sphere), {});
  ASSERT_TRUE(frame.ok()) << frame.status();
  EXPECT_EQ(frame->points.size(), 996U);
  EXPECT_EQ(frame->points.colours.size(), 996U);
  EXPECT_EQ(frame->notes.dropped_points, 4);
  EXPECT_EQ(frame->points.positions[10], sphere.positions[11]);
  EXPECT_EQ(frame->points.positions[995], sphere.positions[999]);
}

TEST(ConvertFrame, LeavesOutLooseVerticesOfAMesh) {
  TriangleMesh cube = testing::Cube(1, Vec3::Zero());
  cube.vertices.insert(cube.vertices.begin(), Vec3(100, 100, 100));
  for (auto& triangle : cube.triangles) {
    for (std::int32_t& v : triangle) ++v;
  }
  const auto frame = ConvertFrame(Mesh(cube), {});
  ASSERT_TRUE(frame.ok()) << frame.status();
  EXPECT_EQ(frame->points.size(), 8U);
  EXPECT_EQ(frame->notes.loose_vertices, 1);
  EXPECT_EQ(frame->notes.dropped_points, 0);
  EXPECT_NEAR(geometry::SignedVolume(frame->mesh), 1, 1e-12);
}

TEST(ConvertFrame, RefusesManyBadPoints) {
  OrientedPoints sphere = testing::Sphere(1000, 0.8, Vec3(0, 0.8, 0));
  for (std::size_t i = 100; i < 111; ++i) sphere.positions[i].y() = kNan;
  EXPECT_THAT(ErrorOf(Cloud(sphere)), AllOf(HasSubstr("11 of 1000 positions are not finite"), HasSubstr("point 100"), HasSubstr("export")));
  sphere = testing::Sphere(1000, 0.8, Vec3(0, 0.8, 0));
  for (std::size_t i = 0; i < 1000; i += 50) sphere.normals[i] = Vec3::Zero();
  EXPECT_THAT(ErrorOf(Cloud(sphere)), AllOf(HasSubstr("20 of 1000 normals are zero"), HasSubstr("they are estimated")));
}

TEST(ConvertFrame, RefusesInvertedNormalsAndMeshes) {
  OrientedPoints sphere = testing::Sphere(1000, 0.8, Vec3(5, 0.8, 0));
  for (Vec3& n : sphere.normals) n = -n;
  EXPECT_THAT(ErrorOf(Cloud(sphere)), AllOf(HasSubstr("point inward"), HasSubstr("turn them round")));
  TriangleMesh cube = testing::Cube(1, Vec3::Zero());
  for (auto& triangle : cube.triangles) std::swap(triangle[0], triangle[1]);
  EXPECT_THAT(ErrorOf(Mesh(cube)), HasSubstr("inside out"));
  cube = testing::Cube(1, Vec3::Zero());
  RawFrame against = Mesh(cube);
  for (const Vec3& v : cube.vertices) against.normals.push_back(Vec3(0.5, 0.5, 0.5) - v);
  EXPECT_THAT(ErrorOf(against), HasSubstr("8 of 8 normals point against the triangles"));
}

TEST(ConvertFrame, OneSidedScansAreNoErrors) {
  // The front half of a sphere: its normals are right, though the centroid lies close to the surface.
  OrientedPoints front;
  const OrientedPoints sphere = testing::Sphere(4000, 0.8, Vec3(0, 0.8, 0));
  for (std::size_t i = 0; i < sphere.size(); ++i) {
    if (sphere.normals[i].z() < 0.3) continue;
    front.positions.push_back(sphere.positions[i]);
    front.normals.push_back(sphere.normals[i]);
  }
  EXPECT_EQ(ErrorOf(Cloud(front)), "");
}

TEST(ConvertFrame, SaysWhichUnitWasMeant) {
  // The spiral's highest point is 1/1000 below the sphere's.
  const auto scaled = [](double height) { return Cloud(testing::Sphere(1000, height / 2 / 0.999, Vec3::Zero())); };
  EXPECT_THAT(ErrorOf(scaled(170.2)), HasSubstr("the frame is 170.2 m tall: did you mean --units cm?"));
  EXPECT_THAT(ErrorOf(scaled(1800)), HasSubstr("did you mean --units mm?"));
  EXPECT_THAT(ErrorOf(scaled(68)), HasSubstr("did you mean --units in?"));
  EXPECT_THAT(ErrorOf(scaled(1.7), {.metres_per_unit = 0.001}), HasSubstr("did you mean --units m?"));
  EXPECT_THAT(ErrorOf(scaled(1e5)), HasSubstr("say the unit"));
  EXPECT_EQ(ErrorOf(scaled(170.2), {.metres_per_unit = 0.01}), "");
}

TEST(ConvertFrame, TellsStrayPointsFromAWrongUnit) {
  OrientedPoints sphere = testing::Sphere(1000, 0.8, Vec3(0, 0.8, 0));
  sphere.positions[0].x() = 4000;
  EXPECT_THAT(ErrorOf(Cloud(sphere)), AllOf(HasSubstr("99 % of its points lie within 1.6 m"), HasSubstr("remove the stray points")));
}

TEST(ConvertFrame, RefusesFramesWithoutContent) {
  EXPECT_THAT(ErrorOf({}), HasSubstr("the frame is empty"));
  EXPECT_THAT(ErrorOf(Cloud({.positions = std::vector<Vec3>(50, Vec3(1, 1, 1)), .normals = std::vector<Vec3>(50, Vec3(0, 1, 0)), .colours = {}})),
              HasSubstr("all points of the frame are the same"));
}

TEST(ReadFrame, NamesThePath) {
  const testing::TemporaryFolder folder;
  const auto path = folder.Write("f1.ply", "junk");
  EXPECT_THAT(std::string(ReadFrame(path, {}).status().message()), AllOf(HasSubstr(path.string() + ": "), HasSubstr("ply")));
  EXPECT_EQ(ReadFrame(folder.path() / "f2.ply", {}).status().code(), absl::StatusCode::kNotFound);
  EXPECT_THAT(std::string(ReadFrame(folder.Write("f1.xyz", "1 2 3"), {}).status().message()), HasSubstr("'.xyz' is no format"));
  EXPECT_THAT(std::string(ReadFrame(folder.path(), {}).status().message()), HasSubstr("no regular file"));
  const auto good = folder.Write("g.OBJ", testing::Obj(testing::Cube(1.5, Vec3::Zero())));
  EXPECT_TRUE(ReadFrame(good, {}).ok());
}

TEST(Outwardness, SeparatesPeopleFromTheirInsideOut) {
  const OrientedPoints sphere = testing::Sphere(1000, 2, Vec3(7, 8, 9));
  EXPECT_NEAR(Outwardness(sphere.positions, sphere.normals), 1, 1e-3);
  base::Random random(5);
  std::vector<Vec3> scattered;
  for (std::size_t i = 0; i < 1000; ++i) scattered.push_back(Vec3(random.Gaussian(), random.Gaussian(), random.Gaussian()).normalized());
  EXPECT_NEAR(Outwardness(sphere.positions, scattered), 0, 0.1);
}

}  // namespace
}  // namespace vorocast::capture
