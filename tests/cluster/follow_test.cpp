// SPDX-License-Identifier: AGPL-3.0-or-later
// From the stage: frames are sent while they are written, through a break in the middle.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <signal.h>

#include <algorithm>
#include <fstream>
#include <iterator>

#include "tests/cluster/farm.h"
#include "tests/cluster/programs.h"
#include "tests/cluster/small_job.h"

namespace vorocast::cluster {
namespace {

using testing::HasSubstr;
namespace fs = std::filesystem;

std::vector<fs::path> FramesOf(const fs::path& folder) {
  std::vector<fs::path> frames;
  for (const auto& entry : fs::directory_iterator(folder)) {
    if (entry.path().extension() == ".ply") frames.push_back(entry.path());
  }
  std::sort(frames.begin(), frames.end());
  return frames;
}

/// Writes a frame as a capture does, in two halves with a pause between them.
void WriteInHalves(const fs::path& from, const fs::path& to, const std::function<void()>& between) {
  std::ifstream source(from, std::ios::binary);
  const std::string bytes{std::istreambuf_iterator<char>(source), {}};
  std::ofstream file(to, std::ios::binary);
  file.write(bytes.data(), static_cast<std::streamsize>(bytes.size() / 2)).flush();
  between();
  file.write(bytes.data() + bytes.size() / 2, static_cast<std::streamsize>(bytes.size() - bytes.size() / 2));
}

TEST(Follow, FramesAreWorkedOnWhileTheTakeGoesOnAndABreakOfTheSchedulerIsWaitedFor) {
  ASSERT_FALSE(UndisturbedDigests().empty());
  Farm farm({.folder = Scratch() / "follow"});
  const fs::path stage = Scratch() / "follow" / "stage";
  fs::create_directories(stage);
  fs::copy(SmallCapture() / "capture.json", stage);
  const std::vector<fs::path> frames = FramesOf(SmallCapture());
  ASSERT_EQ(frames.size(), 12U);

  Running follower(farm.SubmitArguments(stage, {"--follow", "--settle", "2000", "--watch"}));
  const auto finished = [&] { return CountFiles(farm.state() / "artifacts"); };
  for (std::size_t i = 0; i < frames.size(); ++i) {
    const fs::path target = stage / frames[i].filename();
    if (i == 4) {
      // While a half is there nothing of it may go, however long that takes: three other frames are worked on meanwhile.
      WriteInHalves(frames[i], target,
                    [&] { EXPECT_TRUE(Eventually([&] { return finished() >= 3; })) << "nothing was worked on before the take's end"; });
    } else {
      WriteInHalves(frames[i], target, [] {});
    }
    if (i == 7) {
      farm.member("scheduler-0").Signal(SIGKILL);
      ASSERT_TRUE(Eventually([&] { return farm.member("scheduler-0").HasEnded(); }));
    }
    if (i == 9) farm.Revive();
  }
  std::ofstream(stage / "capture.done").close();
  const Outcome outcome = follower.Wait();
  EXPECT_EQ(outcome.exit_code, 0) << outcome.output;
  EXPECT_THAT(outcome.output, HasSubstr("the take is over with 12 frames"));
  EXPECT_EQ(farm.FetchedDigests(), UndisturbedDigests());
}

}  // namespace
}  // namespace vorocast::cluster
