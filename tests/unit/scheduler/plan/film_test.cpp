// SPDX-License-Identifier: AGPL-3.0-or-later
#include "scheduler/plan/film.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fmt/format.h>

namespace vorocast::plan {
namespace {

std::vector<PlannedFrame> Take(std::initializer_list<std::int32_t> numbers) {
  std::vector<PlannedFrame> frames;
  for (const std::int32_t number : numbers)
    frames.push_back({.number = number, .blob = base::HashBytes(fmt::format("{}", number)), .extension = ".ply"});
  return frames;
}

JobSpec Filmed(nlohmann::json effect) {
  JobSpec job;
  job.frames_per_second = 25;
  job.effect = std::move(effect);
  job.film.emplace().width = 320;
  return job;
}

TEST(Film, ATrackedTakeHasAPictureAFrame) { EXPECT_EQ(FilmPictures(Filmed(nullptr), Take({3, 4, 9})), 3); }

TEST(Film, AnEffectHasAPictureForEveryInstantThatItStores) {
  const auto frames = Take({10, 11, 12, 15});  // 0.2 s at 25 a second
  EXPECT_EQ(FilmPictures(Filmed({{"duration_s", "take"}, {"duration_min_s", 0}, {"output_fps", "take"}}), frames), 6);
  EXPECT_EQ(FilmPictures(Filmed({{"duration_s", "take"}, {"duration_min_s", 2}, {"output_fps", "take"}}), frames), 51);
  EXPECT_EQ(FilmPictures(Filmed({{"duration_s", 0.1}, {"duration_min_s", 0}, {"output_fps", 60}}), frames), 7);
}

TEST(Film, EachPictureIsATaskAndTheMovieDoesWithoutThoseThatFail) {
  const auto film = Film(Filmed(nullptr), Take({0, 1}), "assemble", "").value();
  ASSERT_EQ(film.size(), 3u);
  EXPECT_EQ(film[1].name, "picture 1: render");
  EXPECT_EQ(film[1].output, "film/picture_000001.exr");
  EXPECT_EQ(film[1].options["instant"], 1);
  EXPECT_EQ(film[1].options["film"]["width"], 320);
  ASSERT_EQ(film[1].inputs.size(), 1u);
  EXPECT_EQ(film[1].inputs[0].task, "assemble");
  EXPECT_EQ(film[2].output, "film.mp4");
  ASSERT_EQ(film[2].inputs.size(), 2u);
  EXPECT_EQ(film[2].inputs[1].task, film[1].name);
  EXPECT_TRUE(film[2].inputs[1].optional);
}

TEST(Film, ComesLastInThePlanAndReadsTheSimulation) {
  JobSpec job = Filmed({{"name", "heat"}, {"duration_s", 0.04}, {"duration_min_s", 0}, {"output_fps", "take"}});
  job.sheets = false;
  const auto tasks = Plan(job, Take({0, 1, 2}), true).value();
  EXPECT_EQ(tasks.back().name, "film: encode");
  const PlannedTask& picture = tasks[tasks.size() - 2];
  EXPECT_EQ(picture.name, "picture 1: render");
  ASSERT_EQ(picture.inputs.size(), 2u);
  EXPECT_EQ(picture.inputs[1].task, "heat: simulate");
}

TEST(Film, RefusesMorePicturesThanAJobMayHave) {
  const auto film = Film(Filmed({{"duration_s", 3600}, {"duration_min_s", 0}, {"output_fps", 240}}), Take({0}), "assemble", "x: simulate");
  EXPECT_EQ(film.status().code(), absl::StatusCode::kResourceExhausted);
}

TEST(Film, IsKeptInTheJobsRecord) {
  JobSpec job = Filmed(nullptr);
  job.film->colour = "patch";
  const JobSpec read = JobSpecFromJson(ToJson(job)).value();
  ASSERT_TRUE(read.film.has_value());
  EXPECT_EQ(tasks::ToJson(*read.film), tasks::ToJson(*job.film));
  job.film.reset();
  EXPECT_FALSE(JobSpecFromJson(ToJson(job))->film.has_value());
}

}  // namespace
}  // namespace vorocast::plan
