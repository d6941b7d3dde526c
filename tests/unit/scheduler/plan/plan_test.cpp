// SPDX-License-Identifier: AGPL-3.0-or-later
#include "scheduler/plan/plan.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <set>

#include <fmt/format.h>

namespace vorocast::plan {
namespace {

using testing::HasSubstr;

std::vector<PlannedFrame> Take(std::int32_t count) {
  std::vector<PlannedFrame> frames;
  for (std::int32_t i = 0; i < count; ++i) frames.push_back({.number = i, .blob = base::HashBytes(fmt::format("frame {}", i)), .extension = ".ply"});
  return frames;
}

JobSpec Small() {
  JobSpec job;
  job.window_frames = 4;
  job.overlap_frames = 1;
  job.effect = {{"name", "pendulum"}};
  return job;
}

std::vector<PlannedTask> Planned(const JobSpec& job, const std::vector<PlannedFrame>& frames, bool closed) {
  auto tasks = Plan(job, frames, closed);
  EXPECT_TRUE(tasks.ok()) << tasks.status();
  return tasks.ok() ? *std::move(tasks) : std::vector<PlannedTask>{};
}

/// One line a task: its name, what it reads (blobs as #frame, optional inputs in brackets), its output.
std::string Draw(const std::vector<PlannedTask>& tasks) {
  std::string text;
  for (const PlannedTask& task : tasks) {
    text += task.name + " <-";
    for (const PlannedInput& input : task.inputs) {
      const std::string from = input.task.empty() ? fmt::format("#{}", input.frame) : input.task;
      text += fmt::format(" {}={}", input.role, input.optional ? "[" + from + "]" : from);
    }
    text += (task.output.empty() ? "" : " -> " + task.output) + "\n";
  }
  return text;
}

TEST(Plan, DrawsATakeWithItsTemplateChosenByTheService) {
  JobSpec job = Small();
  job.sheets = false;
  EXPECT_EQ(
      Draw(Planned(job, Take(3), true)),
      "frame 0: tessellate <- frame=#0 -> cells/frame_000000.h5\n"
      "frame 1: tessellate <- frame=#1 -> cells/frame_000001.h5\n"
      "frame 2: tessellate <- frame=#2 -> cells/frame_000002.h5\n"
      "template <- frame=#0 frame=#1 frame=#2 cells=[frame 0: tessellate] cells=[frame 1: tessellate] cells=[frame 2: tessellate] -> template.h5\n"
      "guide <- template=template cells=[frame 0: tessellate] cells=[frame 1: tessellate] cells=[frame 2: tessellate]\n"
      "window 0-2: track <- template=template guide=guide cells=[frame 0: tessellate] cells=[frame 1: tessellate] cells=[frame 2: tessellate]\n"
      "assemble <- template=template window=window 0-2: track -> tracked.h5\n"
      "pendulum: simulate <- tracked=assemble -> simulated.h5\n");
}

TEST(Plan, AnExplicitTemplateStartsWithItsOwnFrame) {
  JobSpec job = Small();
  job.template_frame = 1;
  EXPECT_EQ(Draw(Planned(job, Take(2), false)),
            "template <- frame=#1 -> template.h5\n"
            "frame 0: tessellate <- frame=#0 -> cells/frame_000000.h5\n"
            "frame 1: tessellate <- frame=#1 -> cells/frame_000001.h5\n");
  const auto template_task = Planned(job, Take(2), false).front();
  EXPECT_EQ(template_task.options["tessellate"]["iterations"], 50);
  EXPECT_EQ(template_task.options["frame"], 1);
}

TEST(Plan, SheetsShowEveryStage) {
  const auto tasks = Planned(Small(), Take(2), true);
  const std::string drawing = Draw({tasks.end() - 4, tasks.end()});
  EXPECT_EQ(drawing,
            "points: sheet <- frame=#0 frame=#1 -> sheets/points.png\n"
            "cells: sheet <- cells=[frame 0: tessellate] cells=[frame 1: tessellate] template=template -> sheets/cells.png\n"
            "tracked: sheet <- tracked=assemble -> sheets/tracked.png\n"
            "simulated: sheet <- simulated=pendulum: simulate tracked=assemble -> sheets/simulated.png\n");
}

TEST(Plan, PointsSheetShowsTwelveFramesFromFirstToLast) {
  for (const PlannedTask& task : Planned(Small(), Take(100), true)) {
    if (task.name != "points: sheet") continue;
    ASSERT_EQ(task.inputs.size(), 12u);
    EXPECT_EQ(task.inputs.front().frame, 0);
    EXPECT_EQ(task.inputs.back().frame, 99);
  }
}

TEST(Plan, MoreFramesGiveASuperset) {
  for (const std::int32_t template_frame : {-1, 3}) {
    JobSpec job = Small();
    job.template_frame = template_frame;
    const std::vector<PlannedFrame> take = Take(9);
    const std::string whole = Draw(Planned(job, take, true));
    for (std::size_t known = 0; known <= take.size(); ++known) {
      for (const PlannedTask& task : Planned(job, {take.begin(), take.begin() + static_cast<std::ptrdiff_t>(known)}, false)) {
        ASSERT_NE(whole.find(Draw({task})), std::string::npos) << task.name;
      }
    }
  }
}

TEST(Plan, ALongTakeIsGuidedInStretches) {
  JobSpec job = Small();
  job.stretch_frames = 8;
  job.window_frames = 6;
  job.overlap_frames = 2;
  job.sheets = false;
  std::map<std::string, PlannedTask> tasks;
  for (PlannedTask& task : Planned(job, Take(17), true)) tasks.emplace(task.name, std::move(task));
  const auto inputs = [&](const std::string& name, const std::string& role) {
    std::vector<std::string> from;
    for (const PlannedInput& input : tasks.at(name).inputs) {
      if (input.role == role) from.push_back(input.task);
    }
    return from;
  };
  const auto frames = [](std::int32_t first, std::int32_t last) {
    std::vector<std::string> names;
    for (std::int32_t f = first; f <= last; ++f) names.push_back(fmt::format("frame {}: tessellate", f));
    return names;
  };
  EXPECT_EQ(inputs("stretch 0-10: follow", "cells"), frames(0, 10));
  EXPECT_EQ(inputs("stretch 6-16: follow", "cells"), frames(6, 16));
  EXPECT_EQ(inputs("guide", "stretch"), (std::vector<std::string>{"stretch 0-10: follow", "stretch 6-16: follow"}));
  EXPECT_EQ(inputs("guide", "cells"), frames(6, 10));
  EXPECT_EQ(inputs("window 0-5: track", "stretch"), std::vector<std::string>{"stretch 0-10: follow"});
  EXPECT_EQ(inputs("window 4-9: track", "stretch"), (std::vector<std::string>{"stretch 0-10: follow", "stretch 6-16: follow"}));
}

TEST(Plan, TheTemplateOfALongTakeIsChosenFromFewFramesThatComeFirst) {
  const auto tasks = Planned(Small(), Take(500), true);
  const auto chosen = std::ranges::find(tasks, std::string("template"), &PlannedTask::name);
  ASSERT_NE(chosen, tasks.end());
  EXPECT_EQ(chosen - tasks.begin(), 64);
  EXPECT_EQ(chosen->inputs.size(), 2u * 64);
  EXPECT_EQ(chosen->inputs.front().frame, 0);
  EXPECT_EQ(chosen->inputs.back().frame, 499);
}

TEST(Plan, StretchesCoverTheTakeAndShareFrames) {
  for (std::int32_t count = 1; count < 400; ++count) {
    const auto stretches = SplitStretches(count, 48);
    EXPECT_EQ(stretches.size() == 1, count < 72) << count;
    EXPECT_EQ(stretches.front().first, 0);
    EXPECT_EQ(stretches.back().last, count);
    for (std::size_t s = 1; s < stretches.size(); ++s) {
      EXPECT_EQ(stretches[s - 1].last - stretches[s].first, 5) << count;
      EXPECT_GE(stretches[s].last - stretches[s].first, 36) << count;
    }
  }
}

TEST(Plan, FramesMayComeInAnyOrder) {
  std::vector<PlannedFrame> take = Take(5);
  const std::string ordered = Draw(Planned(Small(), take, true));
  std::reverse(take.begin(), take.end());
  EXPECT_EQ(Draw(Planned(Small(), take, true)), ordered);
}

TEST(Plan, EveryInputIsMadeByAnEarlierTask) {
  std::set<std::string> known;
  for (const PlannedTask& task : Planned(Small(), Take(30), true)) {
    for (const PlannedInput& input : task.inputs) EXPECT_TRUE(input.task.empty() || known.contains(input.task)) << task.name;
    EXPECT_TRUE(known.insert(task.name).second) << task.name;
  }
}

TEST(Plan, RefusesWhatCannotBePlanned) {
  EXPECT_EQ(Plan(Small(), {}, true).status().code(), absl::StatusCode::kFailedPrecondition);
  JobSpec job = Small();
  job.template_frame = 77;
  EXPECT_THAT(std::string(Plan(job, Take(2), true).status().message()), HasSubstr("77"));
  EXPECT_TRUE(Plan(job, Take(2), false).ok());
  std::vector<PlannedFrame> twice = Take(2);
  twice.push_back(twice.front());
  EXPECT_EQ(Plan(Small(), twice, true).status().code(), absl::StatusCode::kInvalidArgument);
}

TEST(Plan, OptionsAreWhatTheTasksAccept) {
  JobSpec job = Small();
  job.patches = 300;
  job.interpolated_max = -1;
  for (const PlannedTask& task : Planned(job, Take(25), true)) {
    tasks::TaskSpec spec{.kind = task.kind, .options = task.options};
    for (const PlannedInput& input : task.inputs) {
      spec.inputs.push_back({.role = input.role, .frame = input.frame, .extension = input.extension, .digest = input.blob});
    }
    const auto accepted = tasks::TaskSpecFromJson(tasks::ToJson(spec));
    EXPECT_TRUE(accepted.ok()) << task.name << ": " << accepted.status();
    if (task.name == "assemble") {
      EXPECT_EQ(task.options["interpolated_max"], 2);
    }
  }
}

JobSpec Morphing() {
  JobSpec job = Small();
  job.effect = {{"name", "morph"}};
  job.tessellate.capture = {.metres_per_unit = 1, .up = "+y"};
  job.frames_per_second = 25;
  job.onto = OntoTake{.sequence = "s2", .capture = {.metres_per_unit = 0.01, .up = "-z"}, .frames_per_second = 50};
  return job;
}

/// Frames of the second take: other numbers, other files.
std::vector<PlannedFrame> OntoFrames(std::int32_t count) {
  std::vector<PlannedFrame> frames;
  for (std::int32_t i = 100; i < 100 + count; ++i)
    frames.push_back({.number = i, .blob = base::HashBytes(fmt::format("other frame {}", i)), .extension = ".obj"});
  return frames;
}

std::vector<PlannedTask> PlannedOnto(const JobSpec& job, const KnownTake& take, const KnownTake& onto) {
  auto tasks = Plan(job, take.frames, take.closed, onto);
  EXPECT_TRUE(tasks.ok()) << tasks.status();
  return tasks.ok() ? *std::move(tasks) : std::vector<PlannedTask>{};
}

TEST(PlanOnto, DrawsBothTakesOfAMorph) {
  JobSpec job = Morphing();
  job.sheets = false;
  EXPECT_EQ(Draw(PlannedOnto(job, {Take(1), true}, {OntoFrames(2), true})),
            "frame 0: tessellate <- frame=#0 -> cells/frame_000000.h5\n"
            "template <- frame=#0 cells=[frame 0: tessellate] -> template.h5\n"
            "guide <- template=template cells=[frame 0: tessellate]\n"
            "window 0-0: track <- template=template guide=guide cells=[frame 0: tessellate]\n"
            "assemble <- template=template window=window 0-0: track -> tracked.h5\n"
            "onto: frame 100: tessellate <- frame=#100 -> onto/cells/frame_000100.h5\n"
            "onto: frame 101: tessellate <- frame=#101 -> onto/cells/frame_000101.h5\n"
            "onto: template <- frame=#100 frame=#101 cells=[onto: frame 100: tessellate] cells=[onto: frame 101: tessellate] -> onto/template.h5\n"
            "onto: guide <- template=onto: template cells=[onto: frame 100: tessellate] cells=[onto: frame 101: tessellate]\n"
            "onto: window 100-101: track <- template=onto: template guide=onto: guide cells=[onto: frame 100: tessellate] cells=[onto: frame 101: "
            "tessellate]\n"
            "onto: assemble <- template=onto: template window=onto: window 100-101: track -> onto/tracked.h5\n"
            "morph: simulate <- tracked=assemble target=onto: assemble -> simulated.h5\n");
}

TEST(PlanOnto, EachTakeHasItsOwnUnitsAxisAndRateAndTheSecondItsOwnTemplate) {
  JobSpec job = Morphing();
  job.template_frame = 1;
  std::map<std::string, PlannedTask> tasks;
  for (PlannedTask& task : PlannedOnto(job, {Take(3), true}, {OntoFrames(3), true})) tasks.emplace(task.name, std::move(task));
  EXPECT_EQ(tasks.at("frame 2: tessellate").options["capture"]["metres_per_unit"], 1);
  EXPECT_EQ(tasks.at("onto: frame 102: tessellate").options["capture"]["metres_per_unit"], 0.01);
  EXPECT_EQ(tasks.at("onto: frame 102: tessellate").options["capture"]["up"], "-z");
  EXPECT_EQ(tasks.at("onto: points: sheet").options["capture"]["up"], "-z");
  EXPECT_EQ(tasks.at("assemble").options["frames_per_second"], 25);
  EXPECT_EQ(tasks.at("onto: assemble").options["frames_per_second"], 50);
  EXPECT_EQ(tasks.at("template").options["frame"], 1);
  EXPECT_EQ(tasks.at("onto: template").options["frame"], -1);
  EXPECT_EQ(tasks.at("onto: template").options["tessellate"]["capture"]["up"], "-z");
}

TEST(PlanOnto, SheetsShowBothTakesAndTheMorphOnce) {
  std::set<std::string> outputs;
  for (const PlannedTask& task : PlannedOnto(Morphing(), {Take(2), true}, {OntoFrames(2), true})) {
    if (task.kind == tasks::Kind::kSheet) outputs.insert(task.output);
  }
  EXPECT_EQ(outputs, (std::set<std::string>{"sheets/points.png", "sheets/cells.png", "sheets/tracked.png", "sheets/simulated.png",
                                            "onto/sheets/points.png", "onto/sheets/cells.png", "onto/sheets/tracked.png"}));
}

/// Whichever take arrives first, and in whatever portions: what was named once stays as it was, and every input is there before it is read.
TEST(PlanOnto, MoreFramesOfEitherTakeGiveASuperset) {
  JobSpec job = Morphing();
  job.film.emplace();
  const std::vector<PlannedFrame> first = Take(6);
  const std::vector<PlannedFrame> second = OntoFrames(5);
  const std::string whole = Draw(PlannedOnto(job, {first, true}, {second, true}));
  const auto part = [](const std::vector<PlannedFrame>& take, std::size_t known, bool closed) {
    return KnownTake{{take.begin(), take.begin() + static_cast<std::ptrdiff_t>(known)}, closed};
  };
  for (std::size_t a = 0; a <= first.size() + 1; ++a) {
    for (std::size_t b = 0; b <= second.size() + 1; ++b) {
      const bool a_closed = a > first.size();
      const bool b_closed = b > second.size();
      std::set<std::string> known;
      for (const PlannedTask& task :
           PlannedOnto(job, part(first, std::min(a, first.size()), a_closed), part(second, std::min(b, second.size()), b_closed))) {
        ASSERT_NE(whole.find(Draw({task})), std::string::npos) << task.name;
        for (const PlannedInput& input : task.inputs) EXPECT_TRUE(input.task.empty() || known.contains(input.task)) << task.name;
        EXPECT_TRUE(known.insert(task.name).second) << task.name;
      }
      EXPECT_EQ(known.contains("assemble"), a_closed);
      EXPECT_EQ(known.contains("onto: assemble"), b_closed);
      EXPECT_EQ(known.contains("morph: simulate"), a_closed && b_closed);
      EXPECT_EQ(known.contains("film: encode"), a_closed && b_closed);
    }
  }
}

TEST(PlanOnto, SaysWhichTakeIsWrong) {
  EXPECT_THAT(std::string(Plan(Morphing(), Take(2), true, {{}, true}).status().message()), HasSubstr("second take"));
  EXPECT_THAT(std::string(Plan(Morphing(), {}, true, {OntoFrames(2), true}).status().message()), testing::Not(HasSubstr("second take")));
}

TEST(JobSpec, TheSecondTakeComesBackFromJson) {
  const auto back = JobSpecFromJson(nlohmann::json::parse(ToJson(Morphing()).dump()));
  ASSERT_TRUE(back.ok()) << back.status();
  ASSERT_TRUE(back->onto.has_value());
  EXPECT_EQ(back->onto->sequence, "s2");
  EXPECT_EQ(back->onto->capture.metres_per_unit, 0.01);
  EXPECT_EQ(back->onto->capture.up, "-z");
  EXPECT_EQ(back->onto->frames_per_second, 50);
  nlohmann::json broken = ToJson(Morphing());
  broken["onto"] = "s2";
  EXPECT_THAT(std::string(JobSpecFromJson(broken).status().message()), HasSubstr("onto"));
}

TEST(JobSpec, ComesBackFromJson) {
  JobSpec job = Small();
  job.tessellate.capture = {.metres_per_unit = 0.01, .up = "+z"};
  job.tessellate.seed = 77;
  job.track.regulariser = 0.5;
  job.interpolated_max = -1;
  const auto back = JobSpecFromJson(nlohmann::json::parse(ToJson(job).dump()));
  ASSERT_TRUE(back.ok()) << back.status();
  EXPECT_EQ(ToJson(*back), ToJson(job));
  nlohmann::json broken = ToJson(job);
  broken["tessellate"]["cells"] = 0;
  EXPECT_THAT(std::string(JobSpecFromJson(broken).status().message()), HasSubstr("cells"));
  broken = ToJson(job);
  broken["patches"] = "many";
  EXPECT_THAT(std::string(JobSpecFromJson(broken).status().message()), HasSubstr("patches"));
  // A job recorded before there was such a field still counts.
  nlohmann::json older = ToJson(job);
  older.erase("sheets");
  ASSERT_TRUE(JobSpecFromJson(older).ok());
  EXPECT_EQ(JobSpecFromJson(older)->sheets, JobSpec().sheets);
}

TEST(SplitWindows, CoversEveryFrameAndSharesTheOverlap) {
  for (std::int32_t window = 1; window <= 12; ++window) {
    for (std::int32_t overlap = 0; overlap < window; ++overlap) {
      for (std::int32_t count = 1; count <= 60; ++count) {
        const auto windows = SplitWindows(count, window, overlap);
        ASSERT_FALSE(windows.empty());
        EXPECT_EQ(windows.front().first, 0);
        EXPECT_EQ(windows.back().last, count);
        for (std::size_t i = 0; i < windows.size(); ++i) {
          const std::int32_t size = windows[i].last - windows[i].first;
          if (i > 0) {
            EXPECT_EQ(windows[i - 1].last - windows[i].first, overlap);
          }
          if (i + 1 < windows.size()) {
            EXPECT_EQ(size, window);
          } else {
            EXPECT_LT(2 * (size - window), window - overlap);
            EXPECT_TRUE(windows.size() == 1 || 2 * (size - overlap) >= window - overlap) << count << " " << window << " " << overlap;
          }
        }
      }
    }
  }
  EXPECT_TRUE(SplitWindows(0, 10, 3).empty());
}

}  // namespace
}  // namespace vorocast::plan
