// SPDX-License-Identifier: AGPL-3.0-or-later
#include "services/capture/inspect.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/unit/services/capture/frame_files.h"
#include "tests/unit/services/capture/temporary_folder.h"

namespace vorocast::capture {
namespace {

using geometry::Vec3;
using ::testing::HasSubstr;
using ::testing::Not;
using testing::TemporaryFolder;

std::string NormalFreeObj(std::size_t count) {
  std::string bytes;
  for (const Vec3& p : testing::Sphere(count, 0.85, Vec3(0, 0.85, 0)).positions) {
    bytes += "v " + std::to_string(p.x()) + " " + std::to_string(p.y()) + " " + std::to_string(p.z()) + "\n";
  }
  return bytes;
}

TEST(InspectCapture, GathersFactsAndGoesOnPastBadFrames) {
  const TemporaryFolder folder;
  geometry::TriangleMesh two = testing::Cube(1.7, Vec3::Zero());
  const geometry::TriangleMesh second = testing::Cube(0.5, Vec3(3, 0, 0));
  for (const Vec3& v : second.vertices) two.vertices.push_back(v);
  for (const auto& t : second.triangles) two.triangles.push_back({t[0] + 8, t[1] + 8, t[2] + 8});
  folder.Write("0.obj", testing::Obj(testing::Cube(1.7, Vec3::Zero())));
  folder.Write("1.obj", testing::Obj(two));
  folder.Write("2.obj", "v 1 2\n");
  folder.Write("3.obj", NormalFreeObj(100));
  const auto capture = OpenCapture(folder.path(), {.components = 1});
  ASSERT_TRUE(capture.ok());
  std::vector<double> reported;
  const auto inspection = InspectCapture(*capture, [&](double fraction) { reported.push_back(fraction); });
  ASSERT_TRUE(inspection.ok()) << inspection.status();
  EXPECT_THAT(reported, ::testing::ElementsAre(0.25, 0.5, 0.75, 1));
  ASSERT_EQ(inspection->frames.size(), 4U);
  const FrameFacts& cube = inspection->frames[0];
  EXPECT_EQ(cube.points, 8);
  EXPECT_EQ(cube.triangles, 12);
  EXPECT_TRUE(cube.closed);
  EXPECT_EQ(cube.components, 1);
  EXPECT_EQ(cube.normals, NormalSource::kMesh);
  EXPECT_NEAR(cube.box.sizes().y(), 1.7, 1e-12);
  EXPECT_EQ(inspection->frames[1].components, 2);
  EXPECT_FALSE(inspection->frames[2].status.ok());
  EXPECT_EQ(inspection->frames[3].normals, NormalSource::kEstimated);

  const std::string text = Describe(*inspection);
  EXPECT_THAT(text, HasSubstr("4 frames, 25 frames/s (0.2 s), unit m, +y up"));
  EXPECT_THAT(text, HasSubstr("frames 0-1: 8-16 points, 12-24 triangles, normals from the mesh, closed mesh of 1-2 parts, 1.70 m tall"));
  EXPECT_THAT(text, HasSubstr("frame 2: cannot be used: line 1: a vertex has 2 numbers"));
  EXPECT_THAT(text, HasSubstr("frame 3: 100 points, no normals (they are estimated)"));
  EXPECT_THAT(text, HasSubstr("1 of 4 frames cannot be used"));
  EXPECT_THAT(text, HasSubstr("1 frame of 2 parts where 1 are expected"));
}

TEST(Describe, HintsAtAWrongUnit) {
  const TemporaryFolder folder;
  for (int i = 0; i < 3; ++i) folder.Write(std::to_string(i) + ".ply", testing::BinaryPly(testing::Sphere(2000, 0.85, Vec3(0, 0.85, 0)), false));
  const auto describe = [&](const char* unit) { return Describe(*InspectCapture(*OpenCapture(folder.path(), {.unit = unit}))); };
  EXPECT_THAT(describe("ft"), HasSubstr("did you mean --units m?"));
  EXPECT_THAT(describe("m"), Not(HasSubstr("did you mean")));
  EXPECT_THAT(describe("m"), HasSubstr("frames 0-2: 2,000 points, normals, colours, 1.70 m tall"));
  EXPECT_THAT(describe("mm"), HasSubstr("no frame can be used"));
}

TEST(InspectCapture, RefusesACaptureWithoutFrames) { EXPECT_FALSE(InspectCapture({}).ok()); }

}  // namespace
}  // namespace vorocast::capture
