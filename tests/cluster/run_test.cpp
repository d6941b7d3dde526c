// SPDX-License-Identifier: AGPL-3.0-or-later
// The programs as a new user meets them: results, reuse, bad frames, wrong words.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>

#include "tests/cluster/programs.h"
#include "tests/cluster/small_job.h"

namespace vorocast::cluster {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsSupersetOf;
using testing::Key;
using testing::Not;
using testing::UnorderedElementsAre;

/// What a run in the undisturbed run's folders computes that had not been computed there before.
std::vector<std::string> Computes(const std::vector<std::string>& arguments) {
  const std::filesystem::path state = Scratch() / "undisturbed" / "state";
  const auto before = FinishedTasks(state);
  const Outcome outcome = RunProgram(arguments);
  EXPECT_EQ(outcome.exit_code, 0) << outcome.output;
  std::vector<std::string> computed;
  for (const auto& [task, count] : FinishedTasks(state)) {
    const auto found = before.find(task);
    if (found == before.end() || found->second < count) computed.push_back(task);
  }
  return computed;
}

TEST(RunCommand, LeavesEveryStagesResult) {
  EXPECT_THAT(UndisturbedDigests(),
              IsSupersetOf({Key("template.h5"), Key("tracked.h5"), Key("simulated.h5"), Key("cells/frame_000000.h5"), Key("cells/frame_000011.h5")}));
}

TEST(RunCommand, AnotherEffectComputesOnlyTheEffect) {
  ASSERT_FALSE(UndisturbedDigests().empty());
  EXPECT_THAT(Computes(RunArguments(Scratch() / "undisturbed", "release")), ElementsAre("release: simulate"));
}

TEST(RunCommand, SheetsComeOnTopOfWhatIsThere) {
  ASSERT_FALSE(UndisturbedDigests().empty());
  std::vector<std::string> arguments = RunArguments(Scratch() / "undisturbed");
  std::erase(arguments, "--no-sheets");
  EXPECT_THAT(Computes(arguments), UnorderedElementsAre("points: sheet", "cells: sheet", "tracked: sheet", "simulated: sheet"));
  EXPECT_THAT(Digests(Scratch() / "undisturbed" / "out"),
              IsSupersetOf({Key("sheets/points.png"), Key("sheets/cells.png"), Key("sheets/tracked.png"), Key("sheets/simulated.png")}));
}

TEST(RunCommand, ABadFrameCostsThatFrame) {
  const std::filesystem::path folder = Scratch() / "bad";
  std::filesystem::create_directories(folder);
  std::filesystem::copy(SmallCapture(), folder / "capture", std::filesystem::copy_options::recursive);
  std::filesystem::resize_file(folder / "capture" / "frame_0005.ply", 5000);
  std::vector<std::string> arguments = RunArguments(folder);
  arguments[1] = (folder / "capture").string();
  const Outcome outcome = RunProgram(arguments);
  EXPECT_EQ(outcome.exit_code, 0) << outcome.output;
  EXPECT_THAT(outcome.output, HasSubstr("frame 5"));
  EXPECT_THAT(Digests(folder / "out"), Not(testing::Contains(Key("cells/frame_000005.h5"))));
  EXPECT_THAT(Digests(folder / "out"), testing::Contains(Key("tracked.h5")));
}

TEST(RunCommand, AWrongUnitIsToldBeforeAnythingIsComputed) {
  std::vector<std::string> arguments = RunArguments(Scratch() / "unit");
  arguments.insert(arguments.end(), {"--units", "parsec"});
  const Outcome no_unit = RunProgram(arguments);
  EXPECT_EQ(no_unit.exit_code, 2);
  EXPECT_THAT(no_unit.output, HasSubstr("cm"));
  // Metres taken for millimetres make a person of 1.7 mm.
  arguments.back() = "mm";
  const Outcome wrong_unit = RunProgram(arguments);
  EXPECT_EQ(wrong_unit.exit_code, 2);
  EXPECT_THAT(wrong_unit.output, HasSubstr("--units"));
  EXPECT_FALSE(std::filesystem::exists(Scratch() / "unit" / "state"));
}

TEST(RunCommand, WrongWordsGetAnAnswer) {
  const Outcome effect = RunProgram(RunArguments(Scratch() / "words", "penduluum"));
  EXPECT_EQ(effect.exit_code, 2);
  EXPECT_THAT(effect.output, HasSubstr("pendulum"));
  const Outcome folder = RunProgram({"run", (Scratch() / "nowhere").string()});
  EXPECT_EQ(folder.exit_code, 2);
  EXPECT_THAT(folder.output, HasSubstr("nowhere"));
  const Outcome no_scheduler = RunProgram({"status", "--state", (Scratch() / "nothing").string()});
  EXPECT_EQ(no_scheduler.exit_code, 2);
  EXPECT_THAT(no_scheduler.output, HasSubstr("vorocast serve"));
}

}  // namespace
}  // namespace vorocast::cluster
