// SPDX-License-Identifier: AGPL-3.0-or-later
#include "services/capture/capture.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "services/capture/natural_order.h"
#include "tests/unit/services/capture/temporary_folder.h"

namespace vorocast::capture {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using testing::TemporaryFolder;

std::vector<std::string> Names(const Capture& capture) {
  std::vector<std::string> names;
  for (const CaptureFrame& frame : capture.frames) names.push_back(frame.path.filename().string());
  return names;
}

std::string ErrorOf(const std::filesystem::path& folder, const CaptureOptions& options = {}) {
  const auto capture = OpenCapture(folder, options);
  return capture.ok() ? "" : std::string(capture.status().message());
}

TEST(NaturalOrder, CountsLikeAPerson) {
  EXPECT_TRUE(NaturalLess("frame_2.ply", "frame_10.ply"));
  EXPECT_FALSE(NaturalLess("frame_10.ply", "frame_2.ply"));
  EXPECT_TRUE(NaturalLess("frame_0009.ply", "frame_10.ply"));
  EXPECT_TRUE(NaturalLess("a1b2", "a1b10"));
  EXPECT_TRUE(NaturalLess("a", "b"));
  EXPECT_TRUE(NaturalLess("a", "a1"));
  EXPECT_TRUE(NaturalLess("99999999999999999999998", "99999999999999999999999"));
  EXPECT_TRUE(NaturalLess("99999999999999999999999", "100000000000000000000000"));
  EXPECT_FALSE(NaturalLess("x1", "x1"));
  EXPECT_NE(NaturalLess("x01", "x1"), NaturalLess("x1", "x01"));
}

TEST(OpenCapture, ListsFramesInNaturalOrderAndNumbersThem) {
  const TemporaryFolder folder;
  for (const char* name : {"f10.ply", "f9.PLY", "f1.ply", "notes.txt", ".hidden.ply", "f100.ply"}) folder.Write(name, "");
  std::filesystem::create_directory(folder.path() / "f5.ply");
  const auto capture = OpenCapture(folder.path(), {});
  ASSERT_TRUE(capture.ok()) << capture.status();
  EXPECT_THAT(Names(*capture), ElementsAre("f1.ply", "f9.PLY", "f10.ply", "f100.ply"));
  EXPECT_EQ(capture->frames[2].number, 2);
  EXPECT_EQ(capture->name, folder.path().filename().string());
  EXPECT_EQ(capture->frames_per_second, 25);
  EXPECT_EQ(capture->metres_per_unit, 1);
  EXPECT_EQ(capture->up, "+y");

  // A part of the take keeps the numbers of the whole.
  const auto part = OpenCapture(folder.path(), {.first = 1, .last = 3});
  ASSERT_TRUE(part.ok()) << part.status();
  EXPECT_THAT(Names(*part), ElementsAre("f9.PLY", "f10.ply"));
  EXPECT_EQ(part->frames[0].number, 1);
  EXPECT_EQ(OpenCapture(folder.path(), {.first = 2, .last = 60})->frames.size(), 2U);
  EXPECT_THAT(ErrorOf(folder.path(), {.first = 4}), AllOf(HasSubstr("4:"), HasSubstr("none of its 4")));
  EXPECT_THAT(ErrorOf(folder.path(), {.first = 2, .last = 2}), HasSubstr("2:2"));
  EXPECT_THAT(ErrorOf(folder.path(), {.first = -1}), HasSubstr("-1:"));
}

TEST(OpenCapture, FlagsWinOverTheFileAndTheFileOverDefaults) {
  const TemporaryFolder folder;
  folder.Write("1.obj", "");
  folder.Write("capture.json", R"({"name": "dance", "frames_per_second": 50, "unit": "cm", "up": "-y", "components": 2})");
  const auto capture = OpenCapture(folder.path(), {});
  ASSERT_TRUE(capture.ok()) << capture.status();
  EXPECT_EQ(capture->name, "dance");
  EXPECT_EQ(capture->frames_per_second, 50);
  EXPECT_EQ(capture->metres_per_unit, 0.01);
  EXPECT_EQ(capture->up, "-y");
  EXPECT_EQ(capture->components, 2);
  const auto flagged = OpenCapture(folder.path(), {.name = "runner", .frames_per_second = 30, .unit = "mm", .up = "z", .components = 1});
  ASSERT_TRUE(flagged.ok()) << flagged.status();
  EXPECT_EQ(flagged->name, "runner");
  EXPECT_EQ(flagged->frames_per_second, 30);
  EXPECT_EQ(flagged->metres_per_unit, 0.001);
  EXPECT_EQ(flagged->up, "+z");
  EXPECT_EQ(flagged->components, 1);
}

TEST(OpenCapture, RefusesABadDescription) {
  const TemporaryFolder folder;
  folder.Write("1.obj", "");
  const auto error_with = [&](const char* json) {
    folder.Write("capture.json", json);
    return ErrorOf(folder.path());
  };
  EXPECT_THAT(error_with(R"({"fps": 30})"), AllOf(HasSubstr("capture.json"), HasSubstr("\"fps\" is unknown"), HasSubstr("frames_per_second")));
  EXPECT_THAT(error_with(R"({"unit": 1})"), HasSubstr("\"unit\" should be"));
  EXPECT_THAT(error_with(R"({"unit": "furlong"})"), AllOf(HasSubstr("'furlong'"), HasSubstr("m, cm, mm, in or ft")));
  EXPECT_THAT(error_with(R"({"up": "up"})"), AllOf(HasSubstr("'up'"), HasSubstr("+z or -z")));
  EXPECT_THAT(error_with(R"({"up": "w"})"), HasSubstr("'w'"));
  EXPECT_THAT(error_with(R"({"frames_per_second": 0})"), HasSubstr("0 frames per second"));
  EXPECT_THAT(error_with(R"({"frames_per_second": "30"})"), HasSubstr("should be a number"));
  EXPECT_THAT(error_with(R"({"components": -1})"), HasSubstr("\"components\""));
  EXPECT_THAT(error_with(R"({"components": 1.5})"), HasSubstr("\"components\""));
  EXPECT_THAT(error_with(R"({"name": ""})"), HasSubstr("--name"));
  EXPECT_THAT(error_with(R"([1])"), HasSubstr("JSON object"));
  EXPECT_THAT(error_with(R"({"unit": )"), HasSubstr("is no JSON"));
}

TEST(OpenCapture, RefusesAFolderThatIsNoCapture) {
  const TemporaryFolder folder;
  EXPECT_THAT(ErrorOf(folder.path() / "absent"), HasSubstr("no such folder"));
  EXPECT_THAT(ErrorOf(folder.path()), HasSubstr("holds no frames"));
  const auto file = folder.Write("1.obj", "");
  EXPECT_THAT(ErrorOf(file), HasSubstr("give the folder"));
  folder.Write("1.ply", "");
  EXPECT_THAT(ErrorOf(folder.path()), AllOf(HasSubstr("two formats"), HasSubstr("1.obj"), HasSubstr("1.ply")));
  EXPECT_EQ(OpenCapture(folder.path() / "absent", {}).status().code(), absl::StatusCode::kNotFound);
}

TEST(MetresPerUnit, KnowsItsUnits) {
  EXPECT_EQ(*MetresPerUnit("m"), 1);
  EXPECT_EQ(*MetresPerUnit("cm"), 0.01);
  EXPECT_EQ(*MetresPerUnit("mm"), 0.001);
  EXPECT_EQ(*MetresPerUnit("in"), 0.0254);
  EXPECT_EQ(*MetresPerUnit("ft"), 0.3048);
  EXPECT_FALSE(MetresPerUnit("").ok());
}

}  // namespace
}  // namespace vorocast::capture
