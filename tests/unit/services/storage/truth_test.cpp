// SPDX-License-Identifier: AGPL-3.0-or-later
#include "services/storage/truth.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>

namespace vorocast::storage {
namespace {

namespace fs = std::filesystem;

Truth SmallTruth() {
  return {.frames_per_second = 30, .part = {0, 0, 7}, .points = {{{0, 1, 2}, {3, 4, 5}, {6, 7, 8}}, {{0.1, 1, 2}, {3.1, 4, 5}, {6.1, 7, 8}}}};
}

fs::path File(const std::string& name) {
  return fs::path(testing::TempDir()) / ("vorocast_truth_" + std::to_string(getpid()) + name + ".h5");  // tests run side by side
}

TEST(Truth, ComesBackAsItWasWritten) {
  ASSERT_TRUE(WriteTruth(File("round"), SmallTruth()).ok());
  const auto truth = ReadTruth(File("round"));
  ASSERT_TRUE(truth.ok()) << truth.status();
  EXPECT_EQ(truth->frames_per_second, 30);
  EXPECT_EQ(truth->part, SmallTruth().part);
  EXPECT_EQ(truth->points, SmallTruth().points);
}

TEST(Truth, RefusesFramesOfUnequalLengthAndNothingAtAll) {
  Truth truth = SmallTruth();
  truth.points[1].pop_back();
  EXPECT_EQ(WriteTruth(File("unequal"), truth).code(), absl::StatusCode::kInvalidArgument);
  EXPECT_EQ(WriteTruth(File("empty"), {}).code(), absl::StatusCode::kInvalidArgument);
}

TEST(Truth, ACutFileIsAnErrorAtEveryLength) {
  ASSERT_TRUE(WriteTruth(File("whole"), SmallTruth()).ok());
  EXPECT_EQ(ReadTruth(File("absent")).status().code(), absl::StatusCode::kNotFound);
  const auto size = fs::file_size(File("whole"));
  for (std::uintmax_t length = 0; length + 8 < size; length += 97) {
    fs::copy_file(File("whole"), File("cut"), fs::copy_options::overwrite_existing);
    fs::resize_file(File("cut"), length);
    EXPECT_FALSE(ReadTruth(File("cut")).ok()) << length << " of " << size;
  }
}

}  // namespace
}  // namespace vorocast::storage
