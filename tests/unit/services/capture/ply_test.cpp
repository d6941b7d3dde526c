// SPDX-License-Identifier: AGPL-3.0-or-later
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "services/capture/frame_parser.h"
#include "tests/unit/services/capture/frame_files.h"

namespace vorocast::capture {
namespace {

using geometry::Rgb8;
using geometry::Vec3;
using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using testing::Put;

std::string ErrorOf(const std::string& bytes) {
  const auto frame = ParsePly(bytes);
  return frame.ok() ? "" : std::string(frame.status().message());
}

class PlyByteOrder : public ::testing::TestWithParam<bool> {};

// Every scalar type, an element before the vertices, lists of different types, unknown properties among the known ones.
TEST_P(PlyByteOrder, ReadsEveryTypeAndFurtherElements) {
  const bool big = GetParam();
  std::string bytes = big ? "ply\r\nformat binary_big_endian 1.0\r\n" : "ply\nformat binary_little_endian 1.0\n";
  bytes +=
      "comment a camera goes first\nelement camera 2\nproperty float fov\nproperty list ushort double trail\n"
      "element vertex 3\nproperty char x\nproperty short confidence\nproperty int16 y\nproperty uint z\nproperty list uchar uint8 seen_by\n"
      "property float nx\nproperty float64 ny\nproperty int8 nz\nproperty ushort red\nproperty uint8 green\nproperty int blue\n"
      "element face 2\nproperty uchar flags\nproperty list int uint16 vertex_index\nelement tail 1\nproperty uint32 mark\nend_header\n";
  for (int camera = 0; camera < 2; ++camera) {
    Put<float>(bytes, 1.5F, big);
    Put<std::uint16_t>(bytes, 2, big);
    Put<double>(bytes, 1e300, big);
    Put<double>(bytes, -7, big);
  }
  for (int v = 0; v < 3; ++v) {
    Put<std::int8_t>(bytes, static_cast<std::int8_t>(-100 + v), big);
    Put<std::int16_t>(bytes, -1, big);
    Put<std::int16_t>(bytes, static_cast<std::int16_t>(-30000 + v), big);
    Put<std::uint32_t>(bytes, 4000000000U + static_cast<std::uint32_t>(v), big);
    Put<std::uint8_t>(bytes, static_cast<std::uint8_t>(v), big);
    for (int i = 0; i < v; ++i) Put<std::uint8_t>(bytes, 9, big);
    Put<float>(bytes, 0.5F, big);
    Put<double>(bytes, -0.25, big);
    Put<std::int8_t>(bytes, 1, big);
    Put<std::uint16_t>(bytes, 255, big);
    Put<std::uint8_t>(bytes, static_cast<std::uint8_t>(10 * v), big);
    Put<std::int32_t>(bytes, 7, big);
  }
  for (int face = 0; face < 2; ++face) {
    Put<std::uint8_t>(bytes, 0, big);
    Put<std::int32_t>(bytes, 3, big);
    for (int i = 0; i < 3; ++i) Put<std::uint16_t>(bytes, static_cast<std::uint16_t>((i + face) % 3), big);
  }
  Put<std::uint32_t>(bytes, 0xdeadbeef, big);

  const auto frame = ParsePly(bytes);
  ASSERT_TRUE(frame.ok()) << frame.status();
  EXPECT_THAT(frame->mesh.vertices, ElementsAre(Vec3(-100, -30000, 4000000000.0), Vec3(-99, -29999, 4000000001.0), Vec3(-98, -29998, 4000000002.0)));
  EXPECT_THAT(frame->normals, ElementsAre(Vec3(0.5, -0.25, 1), Vec3(0.5, -0.25, 1), Vec3(0.5, -0.25, 1)));
  EXPECT_THAT(frame->mesh.colours, ElementsAre(Rgb8{255, 0, 7}, Rgb8{255, 10, 7}, Rgb8{255, 20, 7}));
  EXPECT_THAT(frame->mesh.triangles, ElementsAre(ElementsAre(0, 1, 2), ElementsAre(1, 2, 0)));
}

INSTANTIATE_TEST_SUITE_P(Both, PlyByteOrder, ::testing::Values(false, true));

TEST(Ply, ReadsAsciiWithPolygonsAndSpecialNumbers) {
  const auto frame = ParsePly(
      "ply\nformat ascii 1.0\nobj_info x\nelement vertex 5\nproperty float x\nproperty float y\nproperty float z\n"
      "property float red\nproperty float green\nproperty float blue\n"
      "element face 2\nproperty list uchar int vertex_indices\nproperty uchar q\nend_header\n"
      "0 0 0 0 0.5 1\n1.5e0 0 0 1 1 1\r\n\n  +1 -2.5\t0 0 0 0\n0 1 0 2 -1 nan\nnan inf -inf 0 0 0\n4 0 1 2 3 8\n5 0 1 1 2 4 9");
  ASSERT_TRUE(frame.ok()) << frame.status();
  ASSERT_EQ(frame->mesh.vertices.size(), 5U);
  EXPECT_EQ(frame->mesh.vertices[1], Vec3(1.5, 0, 0));
  EXPECT_EQ(frame->mesh.vertices[2], Vec3(1, -2.5, 0));
  EXPECT_TRUE(std::isnan(frame->mesh.vertices[4].x()));
  EXPECT_EQ(frame->mesh.vertices[4].z(), -std::numeric_limits<double>::infinity());
  EXPECT_THAT(frame->mesh.colours, ElementsAre(Rgb8{0, 128, 255}, Rgb8{255, 255, 255}, Rgb8{0, 0, 0}, Rgb8{255, 0, 0}, Rgb8{0, 0, 0}));
  // A quadrilateral becomes two triangles; a repeated corner makes a triangle without area, which is left out.
  EXPECT_THAT(frame->mesh.triangles, ElementsAre(ElementsAre(0, 1, 2), ElementsAre(0, 2, 3), ElementsAre(0, 1, 2), ElementsAre(0, 2, 4)));
  EXPECT_TRUE(frame->normals.empty());
}

TEST(Ply, AnEmptyCloudIsAFrameWithoutPoints) {
  const auto frame = ParsePly("ply\nformat ascii 1.0\nelement vertex 0\nproperty float x\nproperty float y\nproperty float z\nend_header\n");
  ASSERT_TRUE(frame.ok()) << frame.status();
  EXPECT_TRUE(frame->mesh.vertices.empty());
}

TEST(Ply, RefusesCountsThatTheFileCannotHold) {
  const std::string xyz = "property float x\nproperty float y\nproperty float z\n";
  for (const char* format : {"ascii", "binary_little_endian", "binary_big_endian"}) {
    for (const char* count : {"1000000000000", "9223372036854775807"}) {
      const std::string error = ErrorOf(std::string("ply\nformat ") + format + " 1.0\nelement vertex " + count + "\n" + xyz + "end_header\n1 2 3\n");
      EXPECT_THAT(error, AllOf(HasSubstr(count), HasSubstr("vertex"), HasSubstr("truncated"), HasSubstr("copy it again"))) << format;
    }
  }
  EXPECT_THAT(ErrorOf("ply\nformat ascii 1.0\nelement vertex -1\n" + xyz + "end_header\n"), HasSubstr("header line 3"));
  EXPECT_THAT(ErrorOf("ply\nformat ascii 1.0\nelement vertex 99999999999999999999\n" + xyz + "end_header\n"), HasSubstr("header line 3"));
  // Counts in a second element must not hide behind the first.
  EXPECT_THAT(ErrorOf("ply\nformat ascii 1.0\nelement vertex 1\n" + xyz +
                      "element face 4611686018427387904\nproperty list uchar int vertex_indices\nproperty int a\nend_header\n1 2 3\n"),
              HasSubstr("4611686018427387904 × face"));
  // Elements of no bytes are passed over without a loop of 10^18 turns.
  EXPECT_EQ(ErrorOf("ply\nformat ascii 1.0\nelement nothing 1000000000000000000\nelement vertex 1\n" + xyz + "end_header\n1 2 3\n"), "");
}

TEST(Ply, RefusesFewerAndMoreBytesThanDeclared) {
  const std::string whole = testing::BinaryPly(testing::Sphere(3, 1, Vec3::Zero()), false);
  EXPECT_EQ(ErrorOf(whole), "");
  EXPECT_EQ(ErrorOf(whole + "\n"), "");
  EXPECT_THAT(ErrorOf(whole.substr(0, whole.size() - 1)), HasSubstr("truncated"));
  EXPECT_THAT(ErrorOf(whole + "more"), HasSubstr("4 bytes follow the last element"));
  const std::string text = testing::AsciiPly(testing::Cube(1, Vec3::Zero()));
  EXPECT_THAT(ErrorOf(text + "3 0 1 2\n"), HasSubstr("follow the last element"));
  EXPECT_THAT(ErrorOf(text.substr(0, text.size() - 8)), HasSubstr("face 11: the file ends before it"));
}

TEST(Ply, RefusesWhatIsNoPly) {
  EXPECT_THAT(ErrorOf(""), HasSubstr("does not start with 'ply'"));
  EXPECT_THAT(ErrorOf("OFF\n"), HasSubstr("does not start with 'ply'"));
  EXPECT_THAT(ErrorOf("ply\nformat ascii 1.0\nelement vertex 1\n"), HasSubstr("no 'end_header'"));
  EXPECT_THAT(ErrorOf("ply\nend_header\n"), HasSubstr("no 'format'"));
  EXPECT_THAT(ErrorOf("ply\nformat ascii 2.0\nend_header\n"), HasSubstr("header line 2: PLY version '2.0'"));
  EXPECT_THAT(ErrorOf("ply\nformat morse 1.0\nend_header\n"), HasSubstr("'morse'"));
  EXPECT_THAT(ErrorOf("ply\nformat ascii 1.0\nelement face 0\nend_header\n"), HasSubstr("0 elements named vertex"));
  EXPECT_THAT(ErrorOf("ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\nend_header\n1 2\n"), HasSubstr("no x, y and z"));
  EXPECT_THAT(ErrorOf("ply\nformat ascii 1.0\nproperty float x\nend_header\n"), HasSubstr("before the first element"));
  EXPECT_THAT(ErrorOf("ply\nformat ascii 1.0\nelement vertex 1\nproperty half x\nend_header\n"), HasSubstr("unknown type 'half'"));
  EXPECT_THAT(ErrorOf("ply\nformat ascii 1.0\nelement vertex 1\nproperty list float int x\nend_header\n"), HasSubstr("no integer type"));
  EXPECT_THAT(ErrorOf("ply\nformat ascii 1.0\nnonsense\nend_header\n"), HasSubstr("'nonsense'"));
  EXPECT_THAT(ErrorOf("ply\nformat ascii 1.0\ncomment " + std::string(100000, 'x')), HasSubstr("line 3 has 100008 bytes"));
}

TEST(Ply, RefusesBadBodies) {
  const std::string header =
      "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n"
      "element face 1\nproperty list uchar int vertex_indices\nend_header\n";
  EXPECT_THAT(ErrorOf(header + "1 2 3\n1 2\n1 2 3\n3 0 1 2\n"), HasSubstr("vertex 1: line 2 of the body holds fewer values"));
  EXPECT_THAT(ErrorOf(header + "1 2 3\n1 2 3 4\n1 2 3\n3 0 1 2\n"), HasSubstr("vertex 1: line 2 of the body holds more values"));
  EXPECT_THAT(ErrorOf(header + "1 2 3\n1 two 3\n1 2 3\n3 0 1 2\n"), HasSubstr("'two'"));
  EXPECT_THAT(ErrorOf(header + "1 2 3\n1 1e999 3\n1 2 3\n3 0 1 2\n"), HasSubstr("'1e999'"));
  EXPECT_THAT(ErrorOf(header + "1 2 3\n1 2 3\n1 2 3\n3 0 1 3\n"), HasSubstr("face 0: a vertex index is not in 0 … 2"));
  EXPECT_THAT(ErrorOf(header + "1 2 3\n1 2 3\n1 2 3\n3 0 1 -1\n"), HasSubstr("face 0: a vertex index is not in 0 … 2"));
  EXPECT_THAT(ErrorOf(header + "1 2 3\n1 2 3\n1 2 3\n4000000 0 1 2\n"), HasSubstr("has the length 4000000"));
  EXPECT_THAT(ErrorOf(header + "1 2 3\n1 2 3\n1 2 3\n-3 0 1 2\n"), HasSubstr("has the length -3"));
}

}  // namespace
}  // namespace vorocast::capture
