// SPDX-License-Identifier: AGPL-3.0-or-later
#include "services/interchange/usd.h"

#include <fstream>
#include <sstream>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include "tests/unit/services/interchange/sample_moving_cells.h"
#include "tests/unit/services/storage/temporary_folder.h"

namespace vorocast::interchange {
namespace {

using ::testing::HasSubstr;

class Usd : public ::testing::Test {
 protected:
  void SetUp() override {
    ASSERT_EQ(WriteUsd(take_, folder_ / "take.usda", {}), absl::OkStatus());
    std::ostringstream text;
    text << std::ifstream(folder_ / "take.usda").rdbuf();
    text_ = text.str();
  }
  /// The line of the instant `code` in the samples of `attribute`.
  std::string Sample(const std::string& attribute, const std::string& code) const {
    const std::size_t samples = text_.find(attribute + ".timeSamples = {");
    const std::size_t end = text_.find("}\n", samples);
    const std::size_t line = text_.find(" " + code + ": ", samples);
    if (samples == std::string::npos || line > end) return "";
    return text_.substr(line + code.size() + 3, text_.find('\n', line) - line - code.size() - 3);
  }

  TemporaryFolder folder_;
  MovingCells take_ = ThreeCubesMoving();
  std::string text_;
};

TEST_F(Usd, SaysItsUnits) {
  for (const char* line : {"#usda 1.0\n", "metersPerUnit = 1\n", "upAxis = \"Y\"\n", "timeCodesPerSecond = 50\n", "endTimeCode = 3\n"}) {
    EXPECT_THAT(text_, HasSubstr(line));
  }
}

TEST_F(Usd, CellsAreInstancesAtTheirCentroids) {
  EXPECT_THAT(text_, HasSubstr("int[] protoIndices = [0, 1, 2]\n"));
  EXPECT_THAT(text_, HasSubstr("</Take/Cells/Prototypes/cell_00002>"));
  // Cell 0 stays at (0.5, 0.5, 0.5); all rotations start as the identity.
  EXPECT_THAT(Sample("point3f[] positions", "1"), HasSubstr("[(0.5, 0.5, 0.5), "));
  EXPECT_EQ(Sample("quath[] orientations", "0"), "[(1, 0, 0, 0), (1, 0, 0, 0), (1, 0, 0, 0)],");
}

TEST_F(Usd, GoneCellsAreInvisible) {
  EXPECT_EQ(Sample("int64[] invisibleIds", "1"), "[],");
  EXPECT_EQ(Sample("int64[] invisibleIds", "3"), "[2],");
}

TEST_F(Usd, FacesArePartedIntoSkinAndCuts) {
  const std::string middle = text_.substr(text_.find("def Mesh \"cell_00001\""));
  EXPECT_THAT(middle, HasSubstr("int[] faceVertexCounts = [4, 4, 4, 4, 4, 4]\n"));
  EXPECT_THAT(middle.substr(middle.find("\"skin\"")), HasSubstr("int[] indices = [2, 3, 4, 5]\n"));
  EXPECT_THAT(middle.substr(middle.find("GeomSubset \"cut\"")), HasSubstr("int[] indices = [0, 1]\n"));
}

TEST_F(Usd, BracesAndBracketsBalance) {
  for (const auto& [open, close] : {std::pair{'{', '}'}, {'[', ']'}, {'(', ')'}}) {
    EXPECT_EQ(std::ranges::count(text_, open), std::ranges::count(text_, close)) << open;
  }
}

}  // namespace
}  // namespace vorocast::interchange
