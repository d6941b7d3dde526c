// SPDX-License-Identifier: AGPL-3.0-or-later
// A morph of one take into another through the whole service: both are cast and tracked, and what comes out is what the simulation alone makes of
// the two tracked takes.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>

#include "services/storage/hdf5_artifacts.h"
#include "tests/cluster/programs.h"
#include "tests/cluster/small_job.h"

namespace vorocast::cluster {
namespace {

using testing::HasSubstr;
using testing::IsSupersetOf;
using testing::Key;

TEST(MorphCommand, TurnsOneTakeIntoAnotherAsTheSimulationAloneWould) {
  ASSERT_FALSE(UndisturbedDigests().empty());
  const std::filesystem::path state = Scratch() / "undisturbed" / "state";
  const std::filesystem::path out = Scratch() / "morph" / "out";
  const std::filesystem::path second = Scratch() / "morph" / "second";
  ASSERT_EQ(RunProgram({"synth", second.string(), "--count", "5", "--points", "15000", "--seed", "7"}).exit_code, 0);
  std::vector<std::string> arguments = RunArguments(Scratch() / "morph", "morph");
  arguments[5] = state.string();
  arguments.insert(arguments.end(), {"--onto", second.string(), "--onto-name", "the other"});
  const Outcome outcome = RunProgram(arguments);
  ASSERT_EQ(outcome.exit_code, 0) << outcome.output;
  EXPECT_THAT(outcome.output, HasSubstr("onto the other"));
  const auto digests = Digests(out);
  EXPECT_THAT(digests, IsSupersetOf({Key("tracked.h5"), Key("simulated.h5"), Key("onto/tracked.h5"), Key("onto/template.h5"),
                                     Key("onto/cells/frame_000000.h5"), Key("onto/cells/frame_000004.h5")}));
  // The first take is the one that an undisturbed job makes of it.
  EXPECT_EQ(digests.at("tracked.h5"), UndisturbedDigests().at("tracked.h5"));
  EXPECT_NE(digests.at("tracked.h5"), digests.at("onto/tracked.h5"));

  const std::filesystem::path alone = Scratch() / "morph" / "alone.h5";
  const Outcome tried =
      Running({"try", (out / "tracked.h5").string(), "--onto", (out / "onto" / "tracked.h5").string(), "--effect", "morph", "--out", alone.string()},
              "vorocast-simulation")
          .Wait();
  ASSERT_EQ(tried.exit_code, 0) << tried.output;
  const auto expected = storage::ReadSimulatedTake(alone);
  const auto made = storage::ReadSimulatedTake(out / "simulated.h5");
  ASSERT_TRUE(expected.ok() && made.ok()) << expected.status() << made.status();
  EXPECT_EQ(made->effect_json, expected->effect_json);
  EXPECT_EQ(made->time, expected->time);
  EXPECT_EQ(made->cell_rotation, expected->cell_rotation);
  EXPECT_EQ(made->cell_translation, expected->cell_translation);
  EXPECT_EQ(made->cell_state, expected->cell_state);
  ASSERT_FALSE(made->morph.source.empty());
  EXPECT_EQ(made->morph.source, expected->morph.source);
  EXPECT_EQ(made->morph.target, expected->morph.target);
  EXPECT_EQ(made->morph.blend, expected->morph.blend);
  EXPECT_EQ(made->morph.scale, expected->morph.scale);
  EXPECT_EQ(made->morph.rotation, expected->morph.rotation);
  EXPECT_EQ(made->morph.translation, expected->morph.translation);

  const Outcome status = RunProgram({"status", "--state", state.string()});
  EXPECT_EQ(status.exit_code, 2);  // nothing was left running
}

TEST(MorphCommand, IsRefusedBeforeAnythingIsSentWithoutTheSecondTake) {
  const Outcome outcome = RunProgram(RunArguments(Scratch() / "no_second", "morph"));
  EXPECT_EQ(outcome.exit_code, 2);
  EXPECT_THAT(outcome.output, HasSubstr("--onto"));
  std::vector<std::string> no_morph = RunArguments(Scratch() / "no_second");
  no_morph.insert(no_morph.end(), {"--onto", SmallCapture().string()});
  const Outcome second = RunProgram(no_morph);
  EXPECT_EQ(second.exit_code, 2);
  EXPECT_THAT(second.output, HasSubstr("--effect morph"));
  EXPECT_FALSE(std::filesystem::exists(Scratch() / "no_second" / "state"));
}

}  // namespace
}  // namespace vorocast::cluster
