// SPDX-License-Identifier: AGPL-3.0-or-later
#include "services/tasks/options.h"

#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace vorocast::tasks {
namespace {

using nlohmann::json;
using ::testing::AllOf;
using ::testing::HasSubstr;

/// The message with which FromJson refuses, or "accepted".
template <typename Options>
std::string Refusal(const json& value) {
  Options options;
  const absl::Status status = FromJson(value, options);
  if (status.ok()) return "accepted";
  EXPECT_EQ(status.code(), absl::StatusCode::kInvalidArgument);
  return std::string(status.message());
}

/// Writing what was read gives back the same JSON, and names every field.
template <typename Options>
void ExpectRoundTrip(const Options& options, std::size_t field_count) {
  const json written = ToJson(options);
  EXPECT_EQ(written.size(), field_count);
  Options read;
  ASSERT_EQ(FromJson(written, read), absl::OkStatus()) << written;
  EXPECT_EQ(ToJson(read), written);
}

TEST(Options, GoBothWays) {
  TessellateOptions tessellate{
      .capture = {.metres_per_unit = 0.01, .up = "-z"}, .cells = 77, .iterations = 3, .start = "random", .indicator = "cgal", .seed = ~0ULL};
  ExpectRoundTrip(tessellate, 6);
  ExpectRoundTrip(TemplateOptions{.tessellate = tessellate, .frame = -1, .patches = 7}, 3);
  ExpectRoundTrip(GuideOptions{.points = 100, .iterations = 1}, 2);
  ExpectRoundTrip(TrackOptions{.regulariser = 0.1, .frames = {0, 3, 9}}, 7);
  ExpectRoundTrip(AssembleOptions{.frames_per_second = 29.97, .frames = {1, 2}, .interpolated_max = 0}, 3);
  ExpectRoundTrip(SimulateOptions{.effect = {{"gravity", {0, -9.81, 0}}}}, 1);
  ExpectRoundTrip(SheetOptions{.stage = "tracked", .pictures = 2, .width = 100}, 4);
  const FilmOptions film{.width = 640, .height = 360, .samples = 9, .shutter = 0.25, .colour = "patch", .camera = {{"fov_deg", 20}}};
  ExpectRoundTrip(film, 6);
  ExpectRoundTrip(RenderOptions{.film = film, .instant = 17}, 2);
  ExpectRoundTrip(EncodeOptions{.frames_per_second = 29.97}, 1);
}

TEST(Options, ReadingKeepsEveryValue) {
  TessellateOptions options;
  const json value = json::parse(R"({"cells": 12, "iterations": 4, "start": "random", "indicator": "cgal", "seed": 18446744073709551615,
                                     "capture": {"metres_per_unit": 0.001, "up": "-x"}})");
  ASSERT_EQ(FromJson(value, options), absl::OkStatus());
  EXPECT_EQ(options.cells, 12);
  EXPECT_EQ(options.iterations, 4);
  EXPECT_EQ(options.start, "random");
  EXPECT_EQ(options.indicator, "cgal");
  EXPECT_EQ(options.seed, 18446744073709551615ULL);
  EXPECT_EQ(options.capture.metres_per_unit, 0.001);
  EXPECT_EQ(options.capture.up, "-x");
}

TEST(Options, AnAbsentFieldHasItsDefault) {
  GuideOptions options{.points = 999, .iterations = 99};
  ASSERT_EQ(FromJson(json::object(), options), absl::OkStatus());
  EXPECT_EQ(options.points, GuideOptions().points);
}

TEST(Options, AMessageNamesTheFieldAndWhatItMayHold) {
  EXPECT_THAT(Refusal<TessellateOptions>({{"cells", 0}}), AllOf(HasSubstr("options.cells"), HasSubstr("from 1 to 200000")));
  EXPECT_THAT(Refusal<TessellateOptions>({{"cells", 200001}}), HasSubstr("options.cells"));
  EXPECT_THAT(Refusal<TessellateOptions>({{"cells", 10.5}}), HasSubstr("options.cells is 10.5"));
  EXPECT_THAT(Refusal<TessellateOptions>({{"cells", "many"}}), HasSubstr("options.cells"));
  EXPECT_THAT(Refusal<TessellateOptions>({{"cells", 18446744073709551615ULL}}), HasSubstr("options.cells"));
  EXPECT_THAT(Refusal<TessellateOptions>({{"seed", -1}}), HasSubstr("options.seed"));
  EXPECT_THAT(Refusal<TessellateOptions>({{"start", "warm"}}), AllOf(HasSubstr("options.start"), HasSubstr("\"lattice\", \"random\"")));
  EXPECT_THAT(Refusal<TessellateOptions>({{"start", 3}}), HasSubstr("options.start"));
  EXPECT_THAT(Refusal<TessellateOptions>({{"capture", {{"up", "y"}}}}), HasSubstr("options.capture.up"));
  EXPECT_THAT(Refusal<TessellateOptions>({{"capture", 1}}), HasSubstr("options.capture is 1; it must be an object"));
  EXPECT_THAT(Refusal<TessellateOptions>({{"capture", {{"metres_per_unit", 0}}}}), HasSubstr("options.capture.metres_per_unit"));
  EXPECT_THAT(Refusal<TrackOptions>({{"regulariser", "strong"}}), HasSubstr("options.regulariser"));
  EXPECT_THAT(Refusal<TrackOptions>({{"regulariser", nullptr}}), HasSubstr("options.regulariser"));
  EXPECT_THAT(Refusal<TrackOptions>({{"sigma_start_m", 0.01}, {"sigma_end_m", 0.02}}), HasSubstr("options.sigma_end_m"));
  EXPECT_THAT(Refusal<TemplateOptions>({{"tessellate", {{"cells", 10}}}, {"patches", 11}}), HasSubstr("options.patches"));
  EXPECT_THAT(Refusal<SimulateOptions>({{"effect", "pendulum"}}), HasSubstr("options.effect"));
  EXPECT_THAT(Refusal<SheetOptions>(json::array()), HasSubstr("options is a list; it must be an object"));
}

TEST(Options, UnknownFieldsAreRefusedAtEveryDepth) {
  EXPECT_THAT(Refusal<GuideOptions>({{"pionts", 10}}), AllOf(HasSubstr("pionts"), HasSubstr("points")));
  EXPECT_THAT(Refusal<TemplateOptions>({{"tessellate", {{"capture", {{"down", "+y"}}}}}}), HasSubstr("options.tessellate.capture."));
}

TEST(Options, FrameListsAscendAndAreBounded) {
  EXPECT_EQ(Refusal<TrackOptions>({{"frames", {0, 1, 5}}}), "accepted");
  EXPECT_THAT(Refusal<TrackOptions>({{"frames", {0, 1, 1}}}), HasSubstr("options.frames[2]"));
  EXPECT_THAT(Refusal<TrackOptions>({{"frames", {-1, 1}}}), HasSubstr("options.frames[0]"));
  EXPECT_THAT(Refusal<TrackOptions>({{"frames", {0.5}}}), HasSubstr("options.frames[0]"));
  EXPECT_THAT(Refusal<AssembleOptions>({{"frames", std::vector<int>(20001, 0)}}), HasSubstr("at most 20000"));
}

TEST(Options, ADeepEffectIsRefusedNotRecursedInto) {
  json deep = json::object();
  for (int i = 0; i < 40; ++i) deep = json{{"inner", std::move(deep)}};
  EXPECT_THAT(Refusal<SimulateOptions>({{"effect", deep}}), HasSubstr("nested at most"));
}

}  // namespace
}  // namespace vorocast::tasks
