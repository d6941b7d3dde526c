// SPDX-License-Identifier: AGPL-3.0-or-later
#include "services/rendering/movie.h"

#include <array>
#include <cstdio>
#include <fstream>
#include <iterator>
#include <string>

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include "tests/unit/services/storage/temporary_folder.h"

namespace vorocast::rendering {
namespace {

/// One even grey, brighter from picture to picture.
Image Grey(std::int32_t width, std::int32_t height, int number) {
  return {
      width, height,
      std::vector<std::uint8_t>(3 * static_cast<std::size_t>(width) * static_cast<std::size_t>(height), static_cast<std::uint8_t>(50 + 20 * number))};
}

absl::Status WriteMovie(const std::filesystem::path& path, std::int32_t width, std::int32_t height) {
  auto movie = MovieWriter::Open(path, width, height, 25);
  if (!movie.ok()) return movie.status();
  for (int i = 0; i < 5; ++i) RETURN_IF_ERROR(movie->Add(Grey(width, height, i)));
  return movie->Finish();
}

std::string Output(const std::string& command) {
  std::string output;
  FILE* pipe = ::popen(command.c_str(), "r");
  std::array<char, 4096> block;
  while (const std::size_t count = std::fread(block.data(), 1, block.size(), pipe)) output.append(block.data(), count);
  ::pclose(pipe);
  return output;
}

std::string Bytes(const std::filesystem::path& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), {}};
}

TEST(Movie, HoldsThePicturesInTheirOrder) {
  const TemporaryFolder folder;
  ASSERT_EQ(WriteMovie(folder / "a.mp4", 64, 48), absl::OkStatus());
  EXPECT_THAT(
      Output(fmt::format("ffprobe -v error -count_frames -show_entries stream=codec_name,width,height,r_frame_rate,nb_read_frames -of csv=p=0 {}",
                         (folder / "a.mp4").string())),
      ::testing::StartsWith("h264,64,48,25/1,5"));
  const std::string decoded = Output(fmt::format("ffmpeg -v error -i {} -f rawvideo -pix_fmt rgb24 pipe:1", (folder / "a.mp4").string()));
  ASSERT_EQ(decoded.size(), 5u * 64 * 48 * 3);
  for (int i = 0; i < 5; ++i) EXPECT_NEAR(static_cast<unsigned char>(decoded[static_cast<std::size_t>(i) * 64 * 48 * 3 + 3000]), 50 + 20 * i, 3);
}

TEST(Movie, TheSameBytesEveryTime) {
  const TemporaryFolder folder;
  ASSERT_EQ(WriteMovie(folder / "a.mp4", 64, 48), absl::OkStatus());
  ASSERT_EQ(WriteMovie(folder / "b.mp4", 64, 48), absl::OkStatus());
  EXPECT_EQ(Bytes(folder / "a.mp4"), Bytes(folder / "b.mp4"));
}

TEST(Movie, OddSidesGrow) {
  const TemporaryFolder folder;
  ASSERT_EQ(WriteMovie(folder / "a.mp4", 63, 47), absl::OkStatus());
  EXPECT_THAT(Output(fmt::format("ffprobe -v error -show_entries stream=width,height -of csv=p=0 {}", (folder / "a.mp4").string())),
              ::testing::StartsWith("64,48"));
}

TEST(Movie, SaysWhatIsWrong) {
  const TemporaryFolder folder;
  EXPECT_EQ(WriteMovie(folder / "a.mp4", 0, 48).code(), absl::StatusCode::kInvalidArgument);
  EXPECT_EQ(WriteMovie("/nowhere/a.mp4", 1024, 1024).code(), absl::StatusCode::kInternal);
  auto movie = MovieWriter::Open(folder / "b.mp4", 64, 48, 25);
  ASSERT_EQ(movie.status(), absl::OkStatus());
  EXPECT_EQ(movie->Add(Grey(32, 48, 0)).code(), absl::StatusCode::kInvalidArgument);
}

}  // namespace
}  // namespace vorocast::rendering
