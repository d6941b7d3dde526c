// SPDX-License-Identifier: AGPL-3.0-or-later
#include "tests/cluster/small_job.h"

#include <gtest/gtest.h>

#include "tests/cluster/programs.h"

namespace vorocast::cluster {

const std::filesystem::path& SmallCapture() {
  static const std::filesystem::path folder = [] {
    const std::filesystem::path made = Scratch() / "capture";
    const Outcome outcome = RunProgram({"synth", made.string(), "--count", "12", "--points", "15000"});
    EXPECT_EQ(outcome.exit_code, 0) << outcome.output;
    return made;
  }();
  return folder;
}

std::vector<std::string> SmallJobFlags(const std::string& effect) {
  return {"--cells", "400", "--patches", "30", "--template", "0", "--no-sheets", "--effect", effect};
}

std::vector<std::string> RunArguments(const std::filesystem::path& folder, const std::string& effect) {
  std::vector<std::string> arguments = {"run",     SmallCapture().string(),     "--out",     (folder / "out").string(),
                                        "--state", (folder / "state").string(), "--workers", "2"};
  const std::vector<std::string> job = SmallJobFlags(effect);
  arguments.insert(arguments.end(), job.begin(), job.end());
  return arguments;
}

const std::map<std::string, std::string>& UndisturbedDigests() {
  static const std::map<std::string, std::string> digests = [] {
    const std::filesystem::path folder = Scratch() / "undisturbed";
    const Outcome outcome = RunProgram(RunArguments(folder));
    EXPECT_EQ(outcome.exit_code, 0) << outcome.output;
    EXPECT_TRUE(std::filesystem::exists(folder / "out" / "tracked.h5"));
    return Digests(folder / "out");
  }();
  return digests;
}

}  // namespace vorocast::cluster
