// SPDX-License-Identifier: AGPL-3.0-or-later
#include "services/client/job_flags.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

namespace vorocast::client {
namespace {

using testing::HasSubstr;

TEST(ParseFrameRange, TakesFirstAndEnd) {
  capture::CaptureOptions options;
  ASSERT_TRUE(ParseFrameRange("12:40", options).ok());
  EXPECT_EQ(options.first, 12);
  EXPECT_EQ(options.last, 40);
}

TEST(ParseFrameRange, EitherEndMayBeLeftOut) {
  capture::CaptureOptions from_start;
  ASSERT_TRUE(ParseFrameRange(":60", from_start).ok());
  EXPECT_EQ(from_start.first, 0);
  EXPECT_EQ(from_start.last, 60);
  capture::CaptureOptions to_end;
  ASSERT_TRUE(ParseFrameRange("100:", to_end).ok());
  EXPECT_EQ(to_end.first, 100);
  EXPECT_FALSE(to_end.last.has_value());
}

TEST(ParseFrameRange, RefusesWhatIsNoRangeAndSaysHowToWriteOne) {
  for (const char* text : {"60", "a:b", "5:5", "7:3", "-1:4", "1:2:3", "1:99999999999"}) {
    capture::CaptureOptions options;
    const absl::Status status = ParseFrameRange(text, options);
    ASSERT_FALSE(status.ok()) << text;
    EXPECT_THAT(std::string(status.message()), HasSubstr("FIRST:END")) << text;
  }
}

TEST(JobFlags, AShippedEffectIsSentWhole) {
  JobFlags flags;
  flags.effect = "pendulum";
  const auto request = flags.Parse();
  ASSERT_TRUE(request.ok()) << request.status();
  const auto effect = nlohmann::json::parse(request->effect_json());
  EXPECT_EQ(effect.at("name"), "pendulum");
  EXPECT_TRUE(effect.contains("recall"));
}

TEST(JobFlags, AnEffectThatIsNoneIsRefusedBeforeAnythingIsSent) {
  JobFlags flags;
  flags.effect = "penduluum";
  const auto request = flags.Parse();
  ASSERT_FALSE(request.ok());
  EXPECT_THAT(std::string(request.status().message()), HasSubstr("pendulum"));
}

TEST(OntoFlags, AMorphAndASecondTakeNeedEachOther) {
  JobFlags job;
  job.effect = "morph";
  const auto morph = job.Parse();
  ASSERT_TRUE(morph.ok()) << morph.status();
  EXPECT_THAT(std::string(OntoFlags{}.Open(*morph).status().message()), HasSubstr("--onto"));
  job.effect = "pendulum";
  const auto pendulum = job.Parse();
  EXPECT_THAT(std::string(OntoFlags{.folder = "take2", .capture = {}}.Open(*pendulum).status().message()), HasSubstr("--effect morph"));
  job.effect.clear();
  EXPECT_THAT(std::string(OntoFlags{.folder = "take2", .capture = {}}.Open(*job.Parse()).status().message()), HasSubstr("--effect morph"));
  const auto alone = OntoFlags{}.Open(*pendulum);
  ASSERT_TRUE(alone.ok()) << alone.status();
  EXPECT_FALSE(alone->has_value());
}

TEST(JobFlags, AFilmIsAskedForWithItsSize) {
  JobFlags flags;
  ASSERT_TRUE(flags.Parse().ok());
  EXPECT_FALSE(flags.Parse()->has_film());
  flags.film = true;
  flags.film_size = "640x360";
  flags.shutter = 0;
  const auto request = flags.Parse();
  ASSERT_TRUE(request.ok()) << request.status();
  EXPECT_EQ(request->film().width(), 640);
  EXPECT_EQ(request->film().height(), 360);
  EXPECT_EQ(request->film().shutter(), 0);
  for (const char* size : {"640", "640x", "640x360p", "x"}) {
    flags.film_size = size;
    EXPECT_THAT(std::string(flags.Parse().status().message()), HasSubstr("WIDTHxHEIGHT")) << size;
  }
}

TEST(JobFlags, ACameraIsCheckedBeforeAnythingIsSent) {
  JobFlags flags;
  flags.camera = "/nowhere/camera.json";
  EXPECT_THAT(std::string(flags.Parse().status().message()), HasSubstr("give --film too"));
  flags.film = true;
  EXPECT_THAT(std::string(flags.Parse().status().message()), HasSubstr("/nowhere/camera.json"));
}

TEST(JobFlags, TemplateIsAFrameOrAuto) {
  JobFlags flags;
  EXPECT_EQ(flags.Parse()->template_frame(), -1);
  flags.template_frame = "17";
  EXPECT_EQ(flags.Parse()->template_frame(), 17);
  flags.template_frame = "first";
  EXPECT_FALSE(flags.Parse().ok());
}

}  // namespace
}  // namespace vorocast::client
