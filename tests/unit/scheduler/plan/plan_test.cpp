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
