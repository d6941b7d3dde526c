// SPDX-License-Identifier: AGPL-3.0-or-later
#include "services/rendering/stroke_font.h"

#include <gtest/gtest.h>

#include <map>
#include <vector>

namespace vorocast::rendering {
namespace {

Image Paper(std::int32_t width, std::int32_t height) {
  return {.width = width, .height = height, .rgb = std::vector<std::uint8_t>(3 * static_cast<std::size_t>(width * height), 255)};
}

Image Drawn(std::string_view text) {
  Image image = Paper(80, 40);
  DrawText(image, 10, 8, text, {.cap_height = 18, .colour = {0, 0, 0}});
  return image;
}

TEST(StrokeFont, DrawsEveryPrintableCharacterDifferently) {
  std::map<std::vector<std::uint8_t>, char> seen;
  for (char c = 33; c < 127; ++c) {
    const Image image = Drawn(std::string(1, c));
    EXPECT_NE(image.rgb, Paper(80, 40).rgb) << c;
    const auto [place, is_new] = seen.emplace(image.rgb, c);
    EXPECT_TRUE(is_new) << c << " looks like " << place->second;
  }
  EXPECT_EQ(Drawn(" ").rgb, Paper(80, 40).rgb);
}

TEST(StrokeFont, DrawsAQuestionMarkForWhatItDoesNotHave) {
  EXPECT_EQ(Drawn("\xc3\xa9").rgb, Drawn("?").rgb);
  EXPECT_EQ(Drawn("\n").rgb, Drawn("?").rgb);
  EXPECT_EQ(TextWidth("\xe2\x80\xa6", 12), TextWidth("?", 12));
}

TEST(StrokeFont, MeasuresAndFits) {
  EXPECT_EQ(TextWidth("", 12), 0);
  EXPECT_NEAR(TextWidth("frame 12", 24), 2 * TextWidth("frame 12", 12), 1e-9);
  // Digits are all alike, so that counting labels stand still.
  EXPECT_EQ(TextWidth("11:11", 12), TextWidth("80:42", 12));
  EXPECT_EQ(FitText("short", 12, 1000), "short");
  const std::string fitted = FitText("a label that is much too long for its picture", 12, 100);
  EXPECT_TRUE(fitted.ends_with("..."));
  EXPECT_LE(TextWidth(fitted, 12), 100);
  EXPECT_GT(TextWidth(fitted, 12), 80);
  EXPECT_EQ(FitText("wide", 12, 1), "");
}

TEST(StrokeFont, ClipsAtTheEdges) {
  Image image = Paper(20, 10);
  DrawText(image, -8, -6, "clipped on all sides", {.cap_height = 30, .colour = {9, 9, 9}});
  EXPECT_EQ(image.rgb.size(), 600U);
}

}  // namespace
}  // namespace vorocast::rendering
