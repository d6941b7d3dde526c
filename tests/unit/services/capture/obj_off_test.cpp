// SPDX-License-Identifier: AGPL-3.0-or-later
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "services/capture/frame_parser.h"

namespace vorocast::capture {
namespace {

using geometry::Rgb8;
using geometry::Vec3;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

std::string ErrorOf(const absl::StatusOr<RawFrame>& frame) { return frame.ok() ? "" : std::string(frame.status().message()); }

TEST(Obj, ReadsEveryFormOfFace) {
  const auto frame = ParseObj(
      "mtllib a.mtl\no thing\nv 0 0 0\nv 1 0 0 # comment\nv 1 1 0 1.0\nv 0 1 0\nvt 0 0\nvn 0 0 2\nvn 0 0 -1\nusemtl skin\ns off\n"
      "f 1 2 3\nf 1/1 2/1 3/1 4/1\nf -4//1 -3//1 -2//1\nf 1/1/-2 3/1/-2 4/1/-2\n");
  ASSERT_TRUE(frame.ok()) << frame.status();
  EXPECT_THAT(frame->mesh.vertices, ElementsAre(Vec3(0, 0, 0), Vec3(1, 0, 0), Vec3(1, 1, 0), Vec3(0, 1, 0)));
  EXPECT_THAT(frame->mesh.triangles,
              ElementsAre(ElementsAre(0, 1, 2), ElementsAre(0, 1, 2), ElementsAre(0, 2, 3), ElementsAre(0, 1, 2), ElementsAre(0, 2, 3)));
  EXPECT_THAT(frame->normals, ElementsAre(Vec3(0, 0, 1), Vec3(0, 0, 1), Vec3(0, 0, 1), Vec3(0, 0, 1)));
}

TEST(Obj, NegativeIndicesCountFromWhatHasBeenRead) {
  const auto frame = ParseObj("v 0 0 0\nv 1 0 0\nv 0 1 0\nf -3 -2 -1\nv 5 0 0\nf -4 -2 -1\n");
  ASSERT_TRUE(frame.ok()) << frame.status();
  EXPECT_THAT(frame->mesh.triangles, ElementsAre(ElementsAre(0, 1, 2), ElementsAre(0, 2, 3)));
}

TEST(Obj, ReadsAColouredCloudWithNormals) {
  const auto frame = ParseObj("v 0 0 0 1 0.5 0\nv 1 0 0 0 0 1\nvn 0 1 0\nvn 1 0 0\n");
  ASSERT_TRUE(frame.ok()) << frame.status();
  EXPECT_THAT(frame->mesh.colours, ElementsAre(Rgb8{255, 128, 0}, Rgb8{0, 0, 255}));
  EXPECT_THAT(frame->normals, ElementsAre(Vec3(0, 1, 0), Vec3(1, 0, 0)));
  EXPECT_FALSE(frame->is_mesh());
}

TEST(Obj, RefusesWhatDoesNotFit) {
  EXPECT_THAT(ErrorOf(ParseObj("v 0 0\n")), HasSubstr("line 1: a vertex has 2 numbers"));
  EXPECT_THAT(ErrorOf(ParseObj("v 0 0 0\nv 0 x 0\n")), HasSubstr("line 2: 'x' is no number"));
  EXPECT_THAT(ErrorOf(ParseObj("v 0 0 0\nv 0 0 0 1 1 1\n")), HasSubstr("line 2: some vertices have a colour"));
  EXPECT_THAT(ErrorOf(ParseObj("v 0 0 0\nf 1 2 3\n")), HasSubstr("line 2: the index 2 does not fit the 1 read before it"));
  EXPECT_THAT(ErrorOf(ParseObj("v 0 0 0\nf 0 1 1\n")), HasSubstr("line 2: the index 0"));
  EXPECT_THAT(ErrorOf(ParseObj("v 0 0 0\nf 1 1\n")), HasSubstr("2 corners"));
  EXPECT_THAT(ErrorOf(ParseObj("v 0 0 0\nf 1//1 1//1 1//1\n")), HasSubstr("the index 1 does not fit the 0"));
  EXPECT_THAT(ErrorOf(ParseObj("v 0 0 \\\n0\n")), HasSubstr("backslash"));
  EXPECT_THAT(ErrorOf(ParseObj("<html>\n")), HasSubstr("'<html>' is no keyword"));
}

TEST(Off, ReadsThePlainForm) {
  const auto frame = ParseOff("# comment\nOFF # here\n4 2 6\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n4 0 1 2 3 255 0 0\n3 0 2 3\n");
  ASSERT_TRUE(frame.ok()) << frame.status();
  EXPECT_THAT(frame->mesh.vertices, ElementsAre(Vec3(0, 0, 0), Vec3(1, 0, 0), Vec3(1, 1, 0), Vec3(0, 1, 0)));
  EXPECT_THAT(frame->mesh.triangles, ElementsAre(ElementsAre(0, 1, 2), ElementsAre(0, 2, 3), ElementsAre(0, 2, 3)));
}

TEST(Off, ReadsColoursAndNormals) {
  const auto coloured = ParseOff("COFF 2 0 0\n0 0 0 255 128 0 255\n1 0 0 0.0 0.5 1.0 1.0\n");
  ASSERT_TRUE(coloured.ok()) << coloured.status();
  EXPECT_THAT(coloured->mesh.colours, ElementsAre(Rgb8{255, 128, 0}, Rgb8{0, 128, 255}));
  const auto with_normals = ParseOff("NOFF\n2 0\n0 0 0 0 1 0\n1 0 0 1 0 0\n");
  ASSERT_TRUE(with_normals.ok()) << with_normals.status();
  EXPECT_THAT(with_normals->normals, ElementsAre(Vec3(0, 1, 0), Vec3(1, 0, 0)));
  const auto both = ParseOff("STCNOFF\n1 0 0\n0 0 0 0 1 0 9 8 7 255 0.5 0.5\n");
  ASSERT_TRUE(both.ok()) << both.status();
  EXPECT_THAT(both->normals, ElementsAre(Vec3(0, 1, 0)));
  EXPECT_THAT(both->mesh.colours, ElementsAre(Rgb8{9, 8, 7}));
}

TEST(Off, RefusesWhatDoesNotFit) {
  EXPECT_THAT(ErrorOf(ParseOff("")), HasSubstr("empty"));
  EXPECT_THAT(ErrorOf(ParseOff("ply\n")), HasSubstr("starts with 'ply'"));
  EXPECT_THAT(ErrorOf(ParseOff("4OFF\n")), HasSubstr("starts with '4OFF'"));
  EXPECT_THAT(ErrorOf(ParseOff("OFF BINARY\n")), HasSubstr("export it as PLY"));
  EXPECT_THAT(ErrorOf(ParseOff("OFF\nmany 3 0\n")), HasSubstr("line 2"));
  EXPECT_THAT(ErrorOf(ParseOff("OFF\n1000000000000 0 0\n0 0 0\n")), HasSubstr("declares 1000000000000 vertices"));
  EXPECT_THAT(ErrorOf(ParseOff("OFF\n2000000000 0 0\n0 0 0\n")), HasSubstr("truncated"));
  EXPECT_THAT(ErrorOf(ParseOff("OFF\n0 9223372036854775807 0\n0 0 0\n")), HasSubstr("truncated"));
  EXPECT_THAT(ErrorOf(ParseOff("OFF\n-1 0 0\n0 0 0\n")), HasSubstr("damaged"));
  EXPECT_THAT(ErrorOf(ParseOff("OFF\n2 0 0\n0.00 0.00 0.00\n")), HasSubstr("ends after 1 of 2 vertices"));
  EXPECT_THAT(ErrorOf(ParseOff("OFF\n1 0 0\n0 0 0\n0 0 0\n")), HasSubstr("line 4 follows the last face"));
  EXPECT_THAT(ErrorOf(ParseOff("OFF\n1 0 0\n0 0 0 1 1 1\n")), HasSubstr("COFF"));
  EXPECT_THAT(ErrorOf(ParseOff("OFF\n1 1 0\n0 0 0\n3 0 0 1\n")), HasSubstr("line 4, face 0: a vertex index is not in 0 … 0"));
  EXPECT_THAT(ErrorOf(ParseOff("OFF\n1 1 0\n0 0 0\n300000000 0 0 1\n")), HasSubstr("more than the line holds"));
}

}  // namespace
}  // namespace vorocast::capture
